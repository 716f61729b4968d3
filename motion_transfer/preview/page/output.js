// What the work is for: the rendered file, the saved job, the command.

import { byId, plural, say, setText } from "./dom.js";
import { post } from "./server.js";

const PICTURES = [".gif", ".png"];
const FILMS = [".mp4", ".mov", ".webm", ".mkv"];

export function setUpOutput(looking) {
  let mine = false; // this page has asked for the rendering under way
  byId("render").addEventListener("click", async () => {
    mine = (await postOrAsk("render", looking.state.output)) !== null;
  });
  byId("stop").addEventListener("click", () => post("render/stop", {}));
  byId("watch").addEventListener("click", () => watch(looking.state));
  byId("cinema-close").addEventListener("click", () => byId("cinema").close());
  byId("cinema").addEventListener("close", () => {
    byId("film").pause();
    byId("film").removeAttribute("src");
    byId("film").load(); // lets go of the file
  });
  byId("save").addEventListener("click", () => save(looking.state.job_file));
  byId("saved-close").addEventListener("click", () => byId("saved").close());
  byId("copy").addEventListener("click", copy);

  let before = null;
  looking.addEventListener("state", () => {
    const { render } = looking.state;
    showRender(looking.state);
    setText(byId("command"), looking.state.command ?? "");
    if (before === "running" && render.status !== "running") {
      say(wordsOf(render));
      if (render.status === "done" && mine) {
        looking.look({ playing: false });
        watch(looking.state);
      }
      mine = false;
    }
    before = render.status;
  });
}

/** What could not be begun or saved; it stays until something else is. */
function showFault(words) {
  byId("render-words").classList.add("fault");
  setText(byId("render-words"), words);
}

function showRender({ render, driver, error }) {
  const running = render.status === "running";
  byId("render").disabled = running || !driver || Boolean(error);
  byId("stop").hidden = !running;
  byId("watch").hidden = render.status !== "done";
  const bar = byId("render-bar");
  bar.hidden = !running;
  if (render.total) Object.assign(bar, { max: render.total, value: render.done });
  else bar.removeAttribute("value");
  const words = byId("render-words");
  if (render.status === "idle" && words.classList.contains("fault")) return;
  words.classList.toggle("fault", render.status === "failed");
  setText(words, wordsOf(render));
}

function wordsOf({ status, stage, done, total, message, output, seconds }) {
  const looked = { scan: " looked at", estimate: " searched for the person" }[stage] ?? "";
  const time = seconds == null ? "" : ` in ${seconds.toFixed(1)} s`;
  return {
    idle: `Writes ${output}.`,
    running: total ? `${done} of ${plural(total, "frame")}${looked}` : "Beginning…",
    done: `Wrote ${output}${time}. ${message ?? ""}`.trim(),
    failed: message || "Rendering failed.",
    stopped: message || "Stopped. Render again to go on where it was.",
  }[status];
}

/** Show what was rendered, as far as a browser can. */
function watch({ render, revision, key }) {
  const name = render.output.toLowerCase();
  const address = `result?key=${encodeURIComponent(key)}&revision=${revision}`;
  const [film, still] = [byId("film"), byId("still")];
  const cannot = () => {
    film.hidden = still.hidden = true;
    setText(byId("cinema-words"), `This browser cannot show it; it lies at ${render.output}.`);
  };
  setText(byId("cinema-words"), wordsOf(render));
  film.hidden = !FILMS.some((suffix) => name.endsWith(suffix));
  still.hidden = !PICTURES.some((suffix) => name.endsWith(suffix));
  film.onerror = () => film.getAttribute("src") && cannot();
  still.onerror = cannot;
  if (!film.hidden) {
    film.src = address;
    film.play().catch(() => {}); // where it may not start by itself, there are controls
  } else if (!still.hidden) {
    still.src = address;
  } else {
    cannot();
  }
  if (!byId("cinema").open) byId("cinema").showModal();
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
  say(answer.data.error);
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
