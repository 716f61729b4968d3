// Whose motion it is: those that come with the program, and others that are dropped or chosen.

import { byId, make, setText } from "./dom.js";
import { choosingFiles, Taker } from "./sending.js";
import { ask } from "./server.js";

/** Returns what takes files. */
export function setUpMotions(looking) {
  const taker = new Taker("motion", "motion-words", "motion-fault", () => show());
  const choose = async (numbers) => {
    looking.look({ playing: false });
    looking.receive(await ask("motion", { numbers }));
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
  looking.addEventListener("state", show);
  return take;
}

function showMotions({ state }, { busy, words }, choose) {
  if (!state) return;
  const list = byId("motions");
  const signature = JSON.stringify(state.motions);
  if (list.dataset.signature !== signature) { // a focused button stays what it is
    list.dataset.signature = signature;
    list.replaceChildren(...state.motions.map(({ number, name }) => {
      const chip = make("button", { type: "button", className: "chip", textContent: name, title: name });
      chip.dataset.number = number;
      chip.addEventListener("click", () => choose(number));
      return chip;
    }));
  }
  for (const chip of list.children) {
    chip.setAttribute("aria-pressed", String(Number(chip.dataset.number) === state.motion));
    chip.disabled = Boolean(busy);
  }
  byId("add-motion").disabled = Boolean(busy);
  words.hidden = !busy;
  setText(words, busy ?? "");
}
