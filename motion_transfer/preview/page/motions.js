// Whose motion it is: those that come with the program, and others that are dropped or chosen.

import { byId, make, setText } from "./dom.js";
import { fill } from "./options.js";
import { choosingFiles, Taker } from "./sending.js";
import { ask } from "./server.js";

const VIEWS = [ // degrees towards the left hand of who moves
  ["0", "its own camera"],
  ["45", "45° to their left"],
  ["90", "their left side"],
  ["135", "135° to their left"],
  ["180", "the other side"],
  ["-135", "135° to their right"],
  ["-90", "their right side"],
  ["-45", "45° to their right"],
];

/** Returns what takes files. */
export function setUpMotions(looking) {
  const taker = new Taker("motion", "motion-words", "motion-fault", () => show());
  const choose = async (numbers, azimuth = 0) => {
    looking.look({ playing: false });
    looking.receive(await ask("motion", { numbers, azimuth }));
  };
  const take = (files) => taker.work("Sending…", async () => choose(await taker.send(files)));
  const show = () => {
    showMotions(looking, taker, (number) => taker.work("Opening…", () => choose([number])));
  };
  const open = choosingFiles(byId("motion-files"), take);
  byId("add-motion").addEventListener("click", () => open());
  byId("work-cancel").addEventListener("click", () => taker.work("Going back…", async () => {
    looking.receive(await ask("motion/cancel", {}));
  }));
  byId("azimuth").addEventListener("change", ({ target }) => {
    const numbers = [looking.state.motion];
    const azimuth = Number(target.value); // now: while it is worked on, the present one is shown
    taker.work("Turning…", () => choose(numbers, azimuth));
  });
  looking.addEventListener("state", show);
  return take;
}

function showMotions({ state }, { busy, words }, choose) {
  if (!state) return;
  const list = byId("motions");
  const signature = JSON.stringify(state.motions);
  if (list.dataset.signature !== signature) { // a focused button stays what it is
    list.dataset.signature = signature;
    list.replaceChildren(...state.motions.map((motion) => motionTile(motion, choose)));
  }
  for (const tile of list.querySelectorAll("button")) {
    tile.setAttribute("aria-pressed", String(Number(tile.dataset.number) === state.motion));
    tile.disabled = Boolean(busy);
  }
  byId("add-motion").disabled = Boolean(busy);
  showAzimuth(state, Boolean(busy));
  words.hidden = !busy;
  setText(words, busy ?? "");
}

function showAzimuth({ azimuth, can_turn: canTurn }, busy) {
  byId("azimuth-field").hidden = !canTurn && !azimuth;
  byId("azimuth").disabled = busy;
  const listed = VIEWS.map(([value]) => value);
  const words = { [azimuth]: `${azimuth}°`, ...Object.fromEntries(VIEWS) };
  fill(byId("azimuth"), listed, String(azimuth), words);
}

function motionTile({ number, name }, choose) {
  const image = make("img", { src: `motion/${number}`, alt: "", loading: "lazy" });
  image.addEventListener("error", () => image.remove(), { once: true }); // BVH has no pictures
  const tile = make("button", { type: "button", className: "photo", title: name }, image);
  tile.dataset.number = number;
  tile.setAttribute("aria-label", `Motion: ${name}`);
  tile.addEventListener("click", () => choose(number));
  return make("li", {}, tile, make("span", { className: "photo-name", textContent: name }));
}
