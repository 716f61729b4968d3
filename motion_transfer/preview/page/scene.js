// The scene: what is behind, shown small, and how the person stands in it.

import { byId, make, setText } from "./dom.js";
import { choosingFiles, Taker } from "./sending.js";
import { ask } from "./server.js";

const WORDS = {
  white: "White",
  black: "Black",
  photo: "Photo's",
  driver: "Driver's",
  transparent: "None",
};
const TITLES = {
  photo: "The source's photo, its person painted over",
  driver: "The driver's pictures, their person painted over",
  transparent: "Transparent: the output has alpha",
};
const COLOUR_PAUSE_MS = 150; // a colour picker tells of every shade it passes
const SWITCHES = ["on_the_spot", "shadow", "match_colours"];
const FIELDS = ["background_fit", "background_end", "background_blur", "place"];

/** Returns what takes a file as background. */
export function setUpScene(looking, choose) {
  setUpColour(choose);
  const take = setUpFile(looking);
  for (const name of SWITCHES) {
    byId(name).addEventListener("change", (event) => choose({ [name]: event.target.checked }));
  }
  for (const name of FIELDS) {
    byId(name).addEventListener("input", (event) => (event.target.dataset.typed = "yes"));
    byId(name).addEventListener("change", (event) => {
      delete event.target.dataset.typed;
      choose({ [name]: event.target.value.trim() });
    });
  }
  looking.addEventListener("state", () => showScene(looking.state, choose));
  return take;
}

function setUpColour(choose) {
  const colour = byId("colour");
  let pause;
  colour.addEventListener("input", () => {
    clearTimeout(pause);
    colour.dataset.typed = "yes"; // states that come meanwhile know nothing of it yet
    pause = setTimeout(async () => {
      const shade = colour.value;
      await choose({ background: shade });
      if (colour.value === shade) delete colour.dataset.typed;
    }, COLOUR_PAUSE_MS);
  });
}

function setUpFile(looking) {
  const button = byId("add-background");
  const taker = new Taker("background", "background-words", "background-fault", () => {
    button.disabled = Boolean(taker.busy);
    taker.words.hidden = !taker.busy;
    setText(taker.words, taker.busy ?? "");
  });
  const take = (files) => taker.work("Sending…", async () => {
    const [background] = await taker.send(files.slice(0, 1));
    looking.receive(await ask("options", { background }));
  });
  const open = choosingFiles(byId("background-file"), take);
  button.addEventListener("click", () => open());
  return take;
}

function showScene({ backgrounds, options, sources }, choose) {
  showTiles(backgrounds, sources[0]?.number, choose);
  for (const tile of byId("backgrounds").querySelectorAll("button")) {
    tile.setAttribute("aria-pressed", String(tile.dataset.value === options.background));
  }
  const colour = byId("colour");
  if (!colour.dataset.typed && /^#[0-9a-f]{6}$/i.test(options.background)) {
    colour.value = options.background;
  }
  const isFile = !(options.background in WORDS) && !options.background.startsWith("#");
  byId("fit-field").hidden = !isFile && options.background !== "driver";
  byId("end-field").hidden = !isFile;
  for (const name of SWITCHES) byId(name).checked = options[name];
  byId("match_colours").disabled = options.background === "transparent";
  for (const name of FIELDS) {
    const [field, value] = [byId(name), String(options[name] ?? "")];
    if (!field.dataset.typed && !field.getAttribute("aria-invalid")) field.value = value;
  }
}

function showTiles(backgrounds, lead = "nobody", choose) {
  const list = byId("backgrounds");
  const signature = JSON.stringify([backgrounds, lead]);
  if (list.dataset.signature === signature) return; // a focused button stays what it is
  list.dataset.signature = signature;
  list.replaceChildren(...backgrounds.map(({ value, name }, number) => {
    const source = `background/${number}?of=${encodeURIComponent(`${lead} ${value}`)}`;
    const image = make("img", { src: source, alt: "", loading: "lazy" });
    // What cannot be shown yet, such as the photo of a source that is being read, is asked for again.
    image.addEventListener("error", () => {
      setTimeout(() => (image.src = `${source}&again=${Date.now()}`), 1000);
    }, { once: true });
    const title = TITLES[value] ?? WORDS[value] ?? value;
    const tile = make("button", { type: "button", className: "photo wide", title }, image);
    tile.dataset.value = value;
    tile.setAttribute("aria-label", `Background: ${WORDS[value] ?? name}`);
    tile.addEventListener("click", () => choose({ background: value }));
    const words = make("span", { className: "photo-name", textContent: WORDS[value] ?? name });
    return make("li", {}, tile, words);
  }));
}
