// Clothes of other people: a photo, and which parts of the body are taken from it.

import { byId, make, setText } from "./dom.js";
import { choosingFiles, Taker } from "./sending.js";
import { ask } from "./server.js";

const PIECES = {
  Top: ["torso", "upper-arms", "lower-arms"],
  Trousers: ["upper-legs", "lower-legs"],
  Shoes: ["feet"],
};

/** Returns what takes files; they are taken for a top first, as most are. */
export function setUpGarments(looking) {
  const taker = new Taker("source", "garment-words", "garment-fault", () => show());
  const choose = async (garments) => looking.receive(await ask("garments", {
    garments: garments.map(({ number, parts }) => ({ number, parts: parts.join(",") })),
  }));
  const present = () => looking.state.garments;
  const take = (files, piece = "Top") => taker.work("Sending…", async () => {
    const sent = await taker.send(files);
    taker.tell("Looking for the clothes…");
    await choose([...present(), ...sent.map((number) => ({ number, parts: PIECES[piece] }))]);
  });
  const change = (garments) => taker.work("Changing clothes…", () => choose(garments));
  const show = () => showGarments(looking.state, taker, {
    remove: (at) => change(present().filter((_, index) => index !== at)),
    toggle: (at, part) => change(present().map((garment, index) => {
      return index === at ? { ...garment, parts: toggled(garment.parts, part) } : garment;
    })),
  });
  const open = choosingFiles(byId("garment-files"), take);
  byId("add-garments").replaceChildren(...Object.keys(PIECES).map((piece) => {
    const button = make("button", { type: "button", textContent: `${piece}…` });
    button.setAttribute("aria-label", `${piece} from a photo…`);
    button.addEventListener("click", () => open((files) => take(files, piece)));
    return button;
  }));
  looking.addEventListener("state", show);
  return take;
}

/** One part less or more; the last one stays: a garment without parts is none. */
function toggled(parts, part) {
  if (!parts.includes(part)) return [...parts, part];
  return parts.length > 1 ? parts.filter((each) => each !== part) : parts;
}

function showGarments(state, { busy, words }, { remove, toggle }) {
  if (!state) return;
  const list = byId("garments");
  const signature = JSON.stringify([state.garments, Boolean(busy)]);
  if (list.dataset.signature !== signature) {
    list.dataset.signature = signature;
    const focus = list.contains(document.activeElement) && document.activeElement.dataset.at;
    list.replaceChildren(...state.garments.map((garment, index) => {
      return garmentItem(garment, index, state.choices.parts, { remove, toggle });
    }));
    if (focus) list.querySelector(`[data-at="${focus}"]`)?.focus();
  }
  for (const button of list.querySelectorAll("button")) button.classList.toggle("busy", Boolean(busy));
  for (const button of byId("add-garments").children) button.disabled = Boolean(busy);
  const invitation = state.garments.length ? "" : "From a photo of somebody who wears them:";
  setText(words, busy ?? invitation);
  words.hidden = !words.textContent;
}

function garmentItem({ number, name, parts }, index, groups, { remove, toggle }) {
  const image = make("img", { src: `source/${number}?small=1`, alt: "" });
  const away = make("button", { type: "button", className: "narrow", textContent: "×" });
  away.setAttribute("aria-label", `Remove clothes of ${name}`);
  away.addEventListener("click", () => remove(index));
  const chips = groups.map((group) => {
    const chip = make("button", { type: "button", className: "chip", textContent: group });
    chip.dataset.at = `${index} ${group}`;
    chip.setAttribute("aria-pressed", String(parts.includes(group)));
    chip.addEventListener("click", () => toggle(index, group));
    return chip;
  });
  const part = make("div", { className: "chips", role: "group" }, ...chips);
  part.setAttribute("aria-label", `Parts from ${name}`);
  const head = make("div", { className: "row" }, make("span", { className: "garment-name", textContent: name }), away);
  return make("li", {}, make("span", { className: "photo" }, image), make("div", {}, head, part));
}
