// The slider over the driver's frames, the marks on its track, and the numbers beside it.

import { byId, make, oncePerFrame, setText, toRanges } from "./dom.js";

export function setUpTimeline(looking, stage) {
  const slider = byId("slider");
  slider.addEventListener("input", () => {
    looking.look({ frame: Number(slider.value), playing: false });
  });
  const jump = byId("jump");
  jump.addEventListener("input", () => {
    const frame = jump.valueAsNumber;
    if (frame >= 0 && frame < looking.count) looking.look({ frame, playing: false });
  });
  jump.addEventListener("blur", () => (jump.value = looking.frame));
  byId("back").addEventListener("click", () => step(looking, -1));
  byId("on").addEventListener("click", () => step(looking, 1));
  looking.addEventListener("look", () => showPlace(looking));
  const marks = oncePerFrame(() => showMarks(looking, stage));
  looking.addEventListener("state", marks);
  looking.addEventListener("look", marks);
  stage.listeners.push(marks);
}

export function step(looking, frames) {
  looking.look({ frame: looking.frame + frames, playing: false });
}

function showPlace(looking) {
  const { frame, count, rate } = looking;
  const [slider, jump] = [byId("slider"), byId("jump")];
  for (const control of [slider, jump, byId("back"), byId("on")]) control.disabled = count === 0;
  slider.max = Math.max(count - 1, 0);
  slider.value = frame;
  const seconds = clock(frame / rate);
  slider.setAttribute("aria-valuetext", `frame ${frame} of ${count}, ${seconds}`);
  jump.max = slider.max;
  // A number half typed is not to be taken away.
  if (document.activeElement !== jump || looking.playing || jump.valueAsNumber >= 0) {
    if (jump.valueAsNumber !== frame) jump.value = frame;
  }
  setText(byId("clock"), count ? `of ${count} · ${seconds}` : "");
}

function clock(seconds) {
  const minutes = Math.floor(seconds / 60);
  return `${minutes}:${(seconds - 60 * minutes).toFixed(2).padStart(5, "0")}`;
}

function showMarks(looking, stage) {
  const { state, count } = looking;
  if (!count) return byId("marks").replaceChildren();
  const [start, stop] = looking.range;
  const broken = Object.keys(state.broken ?? {}).map(Number).sort((a, b) => a - b);
  const frames = Array.from({ length: count }, (_, index) => index);
  const marks = [
    ...[[start, stop]].map((range) => mark("chosen", range, count)),
    ...toRanges(frames.filter((f) => stage.hasFrame(f))).map((r) => mark("cached", r, count)),
    ...(state.missing ?? []).map((range) => mark("missing", range, count)),
    ...toRanges(broken).map((range) => mark("broken", range, count)),
    ...state.shots.slice(1).map((shot) => mark("cut", [shot.start, shot.start], count)),
  ];
  return byId("marks").replaceChildren(...marks);
}

/** A half-open range of frames; each frame is centred on where the thumb stands for it. */
function mark(kind, [start, stop], count) {
  const place = (edge) => (100 * (edge - 0.5)) / Math.max(count - 1, 1);
  const left = Math.max(0, place(start));
  const right = Math.min(100, place(stop));
  const element = make("span", { className: `mark ${kind}` });
  element.style.left = `${left}%`;
  element.style.width = `${Math.max(right - left, 0)}%`;
  element.dataset.range = `${start}:${stop}`;
  return element;
}
