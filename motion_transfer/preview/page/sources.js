// The photos and videos of the person: those there are, and others that are dropped or chosen.

import { byId, make, say, setText } from "./dom.js";
import { post, postFile } from "./server.js";

export function setUpSources(looking) {
  let busy = null; // what is under way, in words

  /** Run one piece of work, which may throw what to say; meanwhile there is no other. */
  const work = async (words, task) => {
    if (busy) return;
    showFault("");
    tell(words);
    try {
      await task();
    } catch (error) {
      showFault(error.message);
      say(error.message);
    }
    tell(null);
  };
  const tell = (words) => {
    busy = words;
    show();
  };
  const choose = async (numbers) => looking.receive(await answer(post("source", { numbers })));
  const present = () => looking.state.sources.map(({ number }) => number);
  const take = (files, replace) => work("Sending…", async () => {
    const sent = [];
    const drop = Date.now(); // what comes together lies together: a photo and its IUV
    for (const file of files) {
      tell(`Sending ${file.name}…`);
      const name = encodeURIComponent(file.name);
      sent.push((await answer(postFile(`sources/${drop}/${name}`, file))).number);
    }
    tell("Looking for the person…");
    await choose(replace ? sent : [...present(), ...sent]);
  });
  const show = () => showSources(looking, busy, {
    look: (number) => looking.look({ view: "source", photo: number, playing: false }),
    remove: (number) => work("Reading the others…", () => {
      return choose(present().filter((each) => each !== number));
    }),
  });

  byId("lead-photo").addEventListener("click", () => work("Reading again…", () => {
    return choose([looking.photo, ...present().filter((number) => number !== looking.photo)]);
  }));
  setUpButtons(take);
  setUpDropping(take);
  looking.addEventListener("look", show);
}

async function answer(posted) {
  const { ok, data } = await posted;
  if (!ok) throw new Error(data.error);
  return data;
}

function setUpButtons(take) {
  const files = byId("files");
  let replace = false;
  for (const [id, replaces] of [["add-photos", false], ["replace-photos", true]]) {
    byId(id).addEventListener("click", () => {
      replace = replaces;
      files.value = ""; // the same file may be chosen again
      files.click();
    });
  }
  files.addEventListener("change", () => take([...files.files], replace));
}

/** Files may be dropped on the panel; elsewhere the browser would leave the page for them. */
function setUpDropping(take) {
  const panel = byId("sources");
  const [add, replace] = [byId("drop-add"), byId("drop-replace")];
  let leaving;
  const over = (target) => {
    panel.classList.toggle("dropping", target !== null);
    add.classList.toggle("over", panel.contains(target) && target !== replace);
    replace.classList.toggle("over", target === replace);
  };
  document.addEventListener("dragover", (event) => {
    if (!event.dataTransfer.types.includes("Files")) return;
    event.preventDefault();
    event.dataTransfer.dropEffect = panel.contains(event.target) ? "copy" : "none";
    over(event.target);
    clearTimeout(leaving); // "dragleave" comes for every element on the way, this does not
    leaving = setTimeout(over, 300, null);
  });
  document.addEventListener("drop", (event) => {
    if (!event.dataTransfer.types.includes("Files")) return;
    event.preventDefault();
    over(null);
    const files = [...event.dataTransfer.files];
    if (panel.contains(event.target) && files.length) take(files, event.target === replace);
  });
}

function showSources(looking, busy, actions) {
  const { state, view, photo } = looking;
  if (!state) return;
  showTiles(state.sources, actions);
  for (const tile of byId("photos").children) {
    const [show, remove] = tile.querySelectorAll("button");
    const { number } = state.sources[looking.photoIndex];
    const looksAt = view === "source" && Number(tile.dataset.number) === number;
    show.setAttribute("aria-pressed", String(looksAt));
    remove.disabled = Boolean(busy);
  }
  for (const id of ["add-photos", "replace-photos", "lead-photo"]) byId(id).disabled = Boolean(busy);
  byId("lead-photo").hidden = photo === null || looking.photoIndex === 0 || view !== "source";
  const { done, total } = state.source_work ?? {};
  const share = busy && total ? ` ${done} of ${total}` : "";
  const invitation = "Or drop photos, or a video, of this person here; they are kept in";
  setText(byId("sources-words"), busy ? `${busy}${share}` : `${invitation} ${state.dropped_in}/`);
}

function showTiles(sources, { look, remove }) {
  const list = byId("photos");
  const signature = JSON.stringify(sources);
  if (list.dataset.signature === signature) return; // a focused button stays what it is
  list.dataset.signature = signature;
  list.replaceChildren(...sources.map(({ number, name }, index) => {
    const leads = index === 0 && sources.length > 1;
    const image = make("img", { src: `source/${number}?small=1&at=${index}`, alt: "" });
    const mark = leads ? [make("span", { className: "leads", textContent: "leads" })] : [];
    const show = make("button", { type: "button", className: "photo", title: name }, image, ...mark);
    show.setAttribute("aria-label", `Show ${name}${leads ? ", which leads" : ""}`);
    show.addEventListener("click", () => look(number));
    const away = make("button", { type: "button", className: "away", textContent: "×" });
    away.setAttribute("aria-label", `Remove ${name}`);
    away.hidden = sources.length < 2;
    away.addEventListener("click", () => remove(number));
    const words = make("span", { className: "photo-name", textContent: name });
    const tile = make("li", {}, show, words, away);
    tile.dataset.number = number;
    return tile;
  }));
}

/** Why the last choice was not taken; it stays until there is another. */
function showFault(words) {
  byId("sources-fault").hidden = !words;
  setText(byId("sources-fault"), words);
}
