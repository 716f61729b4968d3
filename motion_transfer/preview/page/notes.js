// What the server has to say besides: what it is doing, what is wrong with frames, who is asked.

import { byId, make, plural, setText, timeLeft, toRanges } from "./dom.js";

const WORK = {
  estimate: "Finding the person in the pictures",
  track: "Finding the person in the pictures",
  draw: "Drawing the motion from there",
  scan: "Looking at every frame",
  source: "Reading the photo",
};
const SHOWN = 8; // ranges of frames; more are counted

export function setUpNotes(looking) {
  looking.addEventListener("state", () => {
    const { state } = looking;
    showSubject(state);
    showWork(state);
    showNotes(looking);
  });
}

function showSubject({ source, sources, driver, motions, motion }) {
  const who = source?.name ?? (sources.length ? "…" : null);
  const whose = motions[motion].name;
  setText(byId("subject"), who ? `${who} in the motion of ${whose}` : "");
  const size = driver ? `${driver.width} × ${driver.height}, ${plural(driver.frame_count, "frame")}` : "";
  byId("subject").title = size;
  document.title = who ? `${who} · ${whose} · Motion transfer` : "Motion transfer";
}

/** "Finding the person in the pictures, 34 of 300, about 40 s left" */
export function workWords(work) {
  const { stage, done, total } = work;
  const share = total ? `, ${done} of ${total}` : "";
  return `${WORK[stage] ?? stage}${share}${timeLeft(work)}`;
}

function showWork({ work, driver }) {
  byId("work").hidden = !work;
  if (!work) return;
  setText(byId("work-words"), workWords(work));
  // Until its frames are there, somebody may rather have the one before.
  byId("work-cancel").hidden = Boolean(driver);
  const bar = byId("work-bar");
  if (work.total) Object.assign(bar, { max: work.total, value: work.done });
  else bar.removeAttribute("value");
}

function showNotes(looking) {
  const { notices = [], broken = {}, missing = [] } = looking.state;
  const bad = toRanges(Object.keys(broken).map(Number).sort((a, b) => a - b));
  const signature = JSON.stringify([notices, bad, missing]);
  const list = byId("note-list");
  if (list.dataset.signature === signature) return; // a focused button stays what it is
  list.dataset.signature = signature;
  const items = notices.map((words) => make("li", { textContent: words }));
  if (bad.length) items.push(rangesNote(looking, "Broken", "broken", bad));
  if (missing.length) items.push(rangesNote(looking, "Nobody found in", "missing", missing));
  byId("notes").hidden = items.length === 0;
  list.replaceChildren(...items);
}

/** "Broken: 17, 30–32", each a button that goes there. */
function rangesNote(looking, words, kind, ranges) {
  const item = make("li", { className: kind }, make("span", { className: "swatch" }), `${words} `);
  for (const [start, stop] of ranges.slice(0, SHOWN)) {
    const label = stop - start > 1 ? `${start}–${stop - 1}` : `${start}`;
    const button = make("button", { type: "button", className: "link", textContent: label });
    button.setAttribute("aria-label", `${words} ${label}: go there`);
    button.addEventListener("click", () => looking.look({ frame: start, playing: false }));
    item.append(button, " ");
  }
  if (ranges.length > SHOWN) item.append(`and ${ranges.length - SHOWN} more`);
  return item;
}

/** Say that nobody answers, or (with null) that somebody does again. */
export function showLost(words) {
  byId("lost").hidden = words === null;
  setText(byId("lost"), words ?? "");
}
