// The photos and videos of the person: those there are, and others that are dropped or chosen.

import { byId, make, setText, timeLeft } from "./dom.js";
import { choosingFiles, Taker } from "./sending.js";
import { ask } from "./server.js";

/** Returns what takes files: {add, replace}. */
export function setUpSources(looking) {
  const taker = new Taker("source", "sources-words", "sources-fault", () => show());
  const choose = async (numbers) => looking.receive(await ask("source", { numbers }));
  const present = () => looking.state.sources.map(({ number }) => number);
  const take = (files, replace) => taker.work("Sending…", async () => {
    const sent = await taker.send(files);
    taker.tell("Looking for the person…");
    await choose(replace ? sent : [...present(), ...sent]);
    looking.look({ view: looking.view === "iuv" ? "result" : looking.view });
  });
  const add = (files) => take(files, false);
  const replace = (files) => take(files, true);
  const show = () => showSources(looking, taker, {
    look: (number) => looking.look({ view: "source", photo: number, playing: false }),
    take: (number) => taker.work("Reading it…", () => choose([number])),
    remove: (number) => taker.work("Reading the others…", () => {
      return choose(present().filter((each) => each !== number));
    }),
  });

  const open = choosingFiles(byId("files"), add);
  byId("add-photos").addEventListener("click", () => open());
  byId("welcome-choose").addEventListener("click", () => open());
  byId("replace-photos").addEventListener("click", () => open(replace));
  byId("welcome-example").addEventListener("click", () => {
    const [{ number }] = looking.state.examples;
    taker.work("Reading it…", () => choose([number]));
  });
  byId("lead-photo").addEventListener("click", () => taker.work("Reading again…", () => {
    return choose([looking.photo, ...present().filter((number) => number !== looking.photo)]);
  }));
  looking.addEventListener("look", show);
  return { add, replace };
}

function showSources(looking, { busy }, actions) {
  const { state, view, photo } = looking;
  if (!state) return;
  const isEmpty = !state.sources.length;
  showTiles(state, actions);
  for (const tile of byId("photos").children) {
    const [button, remove] = tile.querySelectorAll("button");
    const looksAt = view === "source" && looking.isLookedAt(Number(tile.dataset.number));
    button.setAttribute("aria-pressed", String(looksAt));
    if (remove) remove.disabled = Boolean(busy);
    else button.disabled = Boolean(busy);
  }
  for (const id of ["add-photos", "replace-photos", "lead-photo", "welcome-choose", "welcome-example"]) {
    byId(id).disabled = Boolean(busy);
  }
  setText(byId("add-photos"), isEmpty ? "Choose a photo…" : "Add…");
  byId("replace-photos").hidden = isEmpty;
  byId("lead-photo").hidden = photo === null || looking.photoIndex === 0 || view !== "source";
  showWords(state, busy);
}

function showWords({ source_work: work, folder, limits, sources }, busy) {
  const share = busy && work?.total ? ` ${work.done} of ${work.total}${timeLeft(work)}` : "";
  const [most, all] = [limits.file, limits.all].map((bytes) => `${Math.round(bytes / 2 ** 30)} GiB`);
  const kept = `What you give stays on this machine, in ${folder}/inputs: up to ${most} a file, ${all} in all.`;
  const more = "More photos of this person show more sides. Drop them anywhere.";
  setText(byId("sources-words"), busy ? `${busy}${share}` : sources.length ? more : "");
  setText(byId("welcome-words"), busy ? `${busy}${share}` : kept);
}

/** What is drawn, or, as long as nobody is, who could be. */
function showTiles({ sources, examples }, { look, take, remove }) {
  const list = byId("photos");
  const signature = JSON.stringify([sources, examples]);
  if (list.dataset.signature === signature) return; // a focused button stays what it is
  list.dataset.signature = signature;
  const chosen = sources.map(({ number }) => number);
  const others = examples.filter(({ number }) => !chosen.includes(number));
  list.replaceChildren(
    ...sources.map((source, index) => sourceTile(source, index, sources.length, look, remove)),
    ...(sources.length ? [] : others.map((example) => exampleTile(example, take))),
  );
}

function sourceTile({ number, name }, index, count, look, remove) {
  const leads = index === 0 && count > 1;
  const mark = leads ? [make("span", { className: "leads", textContent: "leads" })] : [];
  const show = photoButton(number, name, `&at=${index}`, mark);
  show.setAttribute("aria-label", `Show ${name}${leads ? ", which leads" : ""}`);
  show.addEventListener("click", () => look(number));
  const away = make("button", { type: "button", className: "away", textContent: "×" });
  away.setAttribute("aria-label", `Remove ${name}`);
  away.hidden = count < 2;
  away.addEventListener("click", () => remove(number));
  return tileOf(number, name, show, away);
}

function exampleTile({ number, name }, take) {
  const button = photoButton(number, name, "", []);
  button.setAttribute("aria-label", `Take ${name}`);
  button.addEventListener("click", () => take(number));
  return tileOf(number, name, button);
}

function photoButton(number, name, query, marks) {
  const image = make("img", { src: `source/${number}?small=1${query}`, alt: "" });
  return make("button", { type: "button", className: "photo", title: name }, image, ...marks);
}

function tileOf(number, name, ...buttons) {
  const words = make("span", { className: "photo-name", textContent: name });
  const tile = make("li", {}, ...buttons, words);
  tile.dataset.number = number;
  return tile;
}
