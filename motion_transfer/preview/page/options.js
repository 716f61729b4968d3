// The options: shown as the server has them, posted when changed. Nothing is assumed meanwhile:
// the server's next state is what counts.

import { byId, make, plural, say, setText } from "./dom.js";
import { post } from "./server.js";

const WORDS = {
  nhrr: "nhrr (network)",
  texture: "texture (draft)",
  largest: "largest",
  driver: "as the driver",
  crop: "around the person",
  even: "as the driver, even",
  background: "as the background",
  jeans: "in jeans",
  guess: "guessed",
};

const SELECTS = ["renderer", "person", "unseen_legs", "driver_person", "size"];

const GAPS = {
  "": "as usual",
  hold: "repeat the frame before",
  background: "show the background",
};

/** Returns choose(changes), which posts options and shows what the server says to them. */
export function setUpOptions(looking) {
  const send = async (changes) => {
    const { ok, data } = await post("options", changes);
    for (const option of Object.keys(changes)) showFault(option, ok ? null : data.error);
    if (ok) looking.receive(data);
    else say(data.error);
    looking.look({}); // what was refused, or is again as it was
    return ok;
  };
  // One after the other: two that overtake each other would leave the older one standing.
  let last = Promise.resolve();
  const choose = (changes) => (last = last.then(() => send(changes)));
  for (const option of SELECTS) {
    byId(option).addEventListener("change", (event) => choose({ [option]: event.target.value }));
  }
  setUpRange(looking, choose);
  byId("missing").addEventListener("change", ({ target }) => choose({ missing: target.value }));
  byId("frame_rate").addEventListener("change", (event) => {
    choose({ frame_rate: event.target.value.trim() });
  });
  looking.addEventListener("state", () => showOptions(looking));
  return choose;
}

function setUpRange(looking, choose) {
  // Whoever edits video expects the out point to be the last frame that is seen.
  const chooseRange = () => {
    const [first, last] = [byId("in").valueAsNumber, byId("out").valueAsNumber];
    if (Number.isFinite(first + last)) choose({ frames: [first, last + 1] });
  };
  byId("in").addEventListener("change", chooseRange);
  byId("out").addEventListener("change", chooseRange);
  byId("in-here").addEventListener("click", () => setIn(looking, choose));
  byId("out-here").addEventListener("click", () => setOut(looking, choose));
  byId("whole").addEventListener("click", () => choose({ frames: [0, looking.count] }));
}

/** The range begins here; one that ended before goes on to the driver's end. */
export function setIn(looking, choose) {
  const [, stop] = looking.range;
  choose({ frames: [looking.frame, stop > looking.frame ? stop : looking.count] });
}

/** The range ends with this frame; one that began later begins with the driver. */
export function setOut(looking, choose) {
  const [start] = looking.range;
  choose({ frames: [start <= looking.frame ? start : 0, looking.frame + 1] });
}

function showOptions(looking) {
  const { options, choices } = looking.state;
  byId("made").disabled = !looking.isReady;
  for (const name of SELECTS) {
    fill(byId(name), choices[name] ?? [], options[name]);
  }
  showRange(looking);
}

function showRange(looking) {
  const [start, stop] = looking.range;
  const { count, rate, state } = looking;
  setNumber(byId("in"), start);
  setNumber(byId("out"), stop - 1);
  setNumber(byId("frame_rate"), state.options.frame_rate ?? "");
  for (const id of ["in", "out"]) byId(id).disabled = !count;
  for (const id of ["in-here", "out-here"]) byId(id).disabled = !looking.isReady;
  byId("whole").hidden = !count || (start === 0 && stop === count);
  const missing = state.options.missing ?? "";
  byId("missing-field").hidden = !missing && !state.missing.length;
  fill(byId("missing"), Object.keys(GAPS), missing, { ...GAPS, fail: "stop the render" });
  const length = `${plural(stop - start, "frame")}, ${((stop - start) / rate).toFixed(2)} s`;
  setText(byId("length"), count ? length : "");
}

/** What somebody is typing stays, and so does what was refused until it is mended. */
function setNumber(field, value) {
  const kept = document.activeElement === field && field.dataset.typed;
  if (!kept && !field.getAttribute("aria-invalid") && field.value !== String(value)) {
    field.value = value;
  }
}

for (const id of ["in", "out", "frame_rate"]) {
  byId(id).addEventListener("input", (event) => (event.target.dataset.typed = "yes"));
  byId(id).addEventListener("change", (event) => delete event.target.dataset.typed);
}

/** Give a select its values, with the present one among them; what it shows stays if it can. */
export function fill(select, values, value, words = WORDS) {
  const all = values.includes(value) ? values : [...values, value];
  const now = [...select.options].map((option) => option.value);
  if (now.join("\n") !== all.join("\n")) {
    select.replaceChildren(...all.map((each) => make("option", {
      value: each,
      textContent: words[each] ?? describePerson(each),
    })));
  }
  if (select.value !== value) select.value = value;
}

function describePerson(word) {
  return word === "0" ? "the leftmost" : word;
}

/** Words under the fields of an option, or none. */
function showFault(option, words) {
  const fields = document.querySelectorAll(`[data-option="${option}"]`);
  const home = fields[0]?.closest(".row") ?? fields[0]?.closest(".field");
  if (!home) return;
  const id = `fault-${option}`;
  byId(id)?.remove();
  if (words) home.after(make("p", { id, className: "fault", textContent: words }));
  for (const field of fields) {
    if (words) {
      field.setAttribute("aria-invalid", "true");
      field.setAttribute("aria-describedby", id);
    } else {
      field.removeAttribute("aria-invalid");
      field.removeAttribute("aria-describedby");
    }
  }
}
