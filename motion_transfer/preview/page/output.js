// What the file is to be: its name, its format, how good it is; and beginning to render it.

import { byId, say, setText } from "./dom.js";
import { fill } from "./options.js";
import { post } from "./server.js";

const NO_SOUND = "none";
const QUALITIES = [["finest", -6], ["usual", 0], ["smaller file", 6], ["smallest file", 12]];

export function setUpOutput(looking, choose) {
  const chosen = { name: (v) => v.trim(), format: (v) => v, crf: (v) => v, audio: (v) => v };
  for (const [option, read] of Object.entries(chosen)) {
    byId(option).addEventListener("change", ({ target }) => choose({ [option]: read(target.value) }));
  }
  byId("compare").addEventListener("change", ({ target }) => choose({ compare: target.checked }));
  byId("name").addEventListener("input", ({ target }) => (target.dataset.typed = "yes"));
  byId("name").addEventListener("change", ({ target }) => delete target.dataset.typed);
  byId("render").addEventListener("click", () => render(looking));
  byId("save").addEventListener("click", () => save(looking.state.job_file));
  byId("saved-close").addEventListener("click", () => byId("saved").close());
  byId("copy").addEventListener("click", copy);
  looking.addEventListener("state", () => showOutput(looking));
}

async function render(looking) {
  const refused = document.querySelector(".panel [aria-invalid=true]");
  if (refused) {
    refused.closest("details")?.setAttribute("open", "");
    refused.focus();
    return showFault("Mend the value that was refused first, or it is not what is rendered.");
  }
  showFault("");
  const { path } = looking.state.output;
  if (await postOrAsk("renders", path)) say("Rendering.");
  return undefined;
}

/** What could not be begun or saved; it stays until something else is. */
function showFault(words) {
  const line = byId("render-words");
  line.classList.toggle("fault", Boolean(words));
  if (words) say(words);
  if (words) setText(line, words);
  else line.dataset.shown = ""; // what is usual comes with the next state
}

function showOutput(looking) {
  const { output, options, command, error } = looking.state;
  byId("finish").disabled = !looking.isReady;
  byId("render").disabled = Boolean(error || output.fault);
  const name = byId("name");
  if (!name.dataset.typed && !name.getAttribute("aria-invalid") && name.value !== output.name) {
    name.value = looking.isReady ? output.name : "";
  }
  fill(byId("format"), output.formats, output.format);
  showQuality(output, options);
  showSound(output, options);
  byId("compare").checked = options.compare;
  byId("compare").disabled = options.background === "transparent"; // panels have no alpha
  setText(byId("command"), command ?? "");
  const line = byId("render-words");
  const words = output.fault || (looking.isReady ? `To ${output.folder}` : "");
  if (line.dataset.shown === words) return; // what went wrong since then stays
  line.dataset.shown = words;
  line.classList.toggle("fault", Boolean(output.fault));
  setText(line, words);
}

function showQuality({ crf, highest_crf: highest }, options) {
  byId("quality-field").hidden = crf == null;
  if (crf == null) return;
  const words = {};
  for (const [word, more] of QUALITIES) {
    words[more ? String(Math.min(crf + more, highest)) : ""] = word;
  }
  const order = QUALITIES.map(([word]) => Object.keys(words).find((key) => words[key] === word));
  const value = options.crf == null ? "" : String(options.crf);
  if (!(value in words)) words[value] = `crf ${value}`;
  fill(byId("crf"), order, value, words);
}

function showSound({ has_sound: hasSound }, { audio }) {
  byId("sound-field").hidden = !hasSound;
  const words = { "": "the motion's own, if any", [NO_SOUND]: "none" };
  fill(byId("audio"), ["", NO_SOUND], audio ?? "", words);
}

async function save(file) {
  const done = await postOrAsk("job", file);
  if (!done) return;
  setText(byId("saved-words"), `${done.path}. To render it: mt batch run ${done.path}`);
  setText(byId("saved-text"), done.text);
  byId("saved").showModal();
}

async function copy() {
  const command = byId("command");
  try {
    await navigator.clipboard.writeText(command.textContent);
    confirmCopy("Copied");
  } catch {
    getSelection().selectAllChildren(command);
    confirmCopy("Selected: copy it");
  }
}

function confirmCopy(words) {
  say(`${words}.`);
  setText(byId("copy"), words);
  setTimeout(() => setText(byId("copy"), "Copy command"), 2000);
}

/** Post; where a file would be overwritten, ask first. Returns the answer, or null. */
async function postOrAsk(path, file) {
  let answer = await post(path, { replace: false });
  if (answer.status === 409 && answer.data.exists) {
    if (!(await ask(`${file} exists already. Replace it?`))) return null;
    answer = await post(path, { replace: true });
  }
  if (answer.ok) return answer.data;
  showFault(answer.data.error);
  return null;
}

function ask(words) {
  const question = byId("question");
  setText(byId("question-words"), words);
  question.returnValue = "";
  question.showModal();
  return new Promise((resolve) => {
    byId("question-yes").onclick = () => question.close("yes");
    byId("question-no").onclick = () => question.close("");
    question.onclose = () => resolve(question.returnValue === "yes");
  });
}
