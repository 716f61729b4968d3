// The crop window: its outline on the frame, and drawing another.

import { byId, say, setText } from "./dom.js";
import { driverView, showsDriverFrame } from "./views.js";

const LEAST_PX = 8; // of the driver's frame; anything smaller was a click

export function setUpCrop(looking, choose) {
  const draw = byId("draw");
  let drawn = null; // the window under the pointer

  draw.addEventListener("click", () => {
    const drawing = !looking.drawing;
    const fits = showsDriverFrame(looking.view, looking);
    const view = drawing && !fits ? driverView(looking.state) : looking.view;
    looking.look({ drawing, view, playing: false });
    if (drawing) say("Drag a square on the picture, or type left, top and side.");
  });
  byId("automatic").addEventListener("click", async () => {
    await choose({ window: null });
    showWords(looking); // also in place of numbers that were refused
  });
  byId("outlined").addEventListener("change", () => looking.look({}));
  setUpNumbers(looking, choose);

  setUpDrawing(looking, {
    show(window) {
      drawn = window;
      showOutline(looking, drawn);
    },
    async done(window) {
      if (window) await choose({ window });
      drawn = null;
      looking.look(window ? { drawing: false } : {});
    },
  });
  looking.addEventListener("look", () => {
    draw.setAttribute("aria-pressed", String(looking.drawing));
    byId("stage").classList.toggle("drawing", looking.drawing);
    showOutline(looking, drawn);
    showWords(looking);
  });
}

function setUpNumbers(looking, choose) {
  const fields = ["x", "y", "side"].map((name) => byId(`window-${name}`));
  for (const field of fields) {
    field.addEventListener("change", () => {
      // as it was typed: what is no number is refused in words, as any other value
      choose({ window: fields.map((each) => each.value).join(",") });
    });
  }
}

function setUpDrawing(looking, { show, done }) {
  const frame = byId("frame");
  let from = null;
  let window = null;

  frame.addEventListener("pointerdown", (event) => {
    if (!looking.drawing || event.button !== 0) return;
    event.preventDefault();
    frame.setPointerCapture(event.pointerId);
    from = pointOf(event, frame, looking);
    window = null;
  });
  frame.addEventListener("pointermove", (event) => {
    if (!from) return;
    window = squareBetween(from, pointOf(event, frame, looking));
    show(window);
  });
  frame.addEventListener("pointerup", () => {
    if (!from) return;
    from = null;
    done(window && window.side >= LEAST_PX ? window : null);
  });
  const give = () => {
    if (!from) return;
    from = null;
    done(null);
  };
  frame.addEventListener("pointercancel", give);
  looking.addEventListener("look", () => {
    if (!looking.drawing) give();
  });
}

/** Where a pointer is, in pixels of the driver's frame. */
function pointOf(event, frame, looking) {
  const box = frame.getBoundingClientRect();
  const { width, height } = looking.state.driver;
  return {
    x: ((event.clientX - box.left) / box.width) * width,
    y: ((event.clientY - box.top) / box.height) * height,
  };
}

/** The square from a corner towards a point, as wide as the longer way. */
function squareBetween(from, to) {
  const side = Math.round(Math.max(Math.abs(to.x - from.x), Math.abs(to.y - from.y)));
  return {
    x: Math.round(to.x < from.x ? from.x - side : from.x),
    y: Math.round(to.y < from.y ? from.y - side : from.y),
    side,
  };
}

function showOutline(looking, drawn) {
  const svg = byId("outline");
  const { state, view } = looking;
  const window = drawn ?? looking.shot;
  const wanted = byId("outlined").checked || looking.drawing;
  svg.toggleAttribute(
    "hidden",
    !(window && wanted && state?.driver && showsDriverFrame(view, looking)),
  );
  if (svg.hasAttribute("hidden")) return;
  const { width, height } = state.driver;
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("preserveAspectRatio", "none");
  svg.classList.toggle("by-hand", Boolean(drawn ?? state.options.window));
  // What lies outside the picture is cut off, but for a window that is being drawn.
  const box = drawn ? boxOf(drawn) : within(window, width, height);
  const isAll = box.width === width && box.height === height;
  svg.toggleAttribute("hidden", isAll && !looking.drawing);
  for (const rect of svg.children) {
    for (const [name, value] of Object.entries(box)) rect.setAttribute(name, value);
  }
}

function boxOf({ x, y, side }) {
  return { x, y, width: side, height: side };
}

/** The part of a window that lies in the frame. */
function within({ x, y, side }, width, height) {
  const [left, top] = [Math.max(0, x), Math.max(0, y)];
  const [right, bottom] = [Math.min(width, x + side), Math.min(height, y + side)];
  return { x: left, y: top, width: Math.max(0, right - left), height: Math.max(0, bottom - top) };
}

function showWords(looking) {
  const { state, shot } = looking;
  byId("draw").disabled = !state?.driver;
  const isRefused = byId("window-x").getAttribute("aria-invalid");
  byId("automatic").disabled = !state?.options.window && !isRefused;
  for (const name of ["x", "y", "side"]) {
    const field = byId(`window-${name}`);
    field.disabled = !shot;
    const kept = document.activeElement === field || field.getAttribute("aria-invalid");
    if (shot && !kept && field.value !== String(shot[name])) field.value = shot[name];
  }
  setText(byId("window-words"), describe(looking));
}

function describe({ state, shot, drawing }) {
  if (drawing) return "Drag a square on the picture.";
  if (!shot) return state?.shots?.length ? "None here: outside the range." : "Not known yet.";
  if (state.options.window) return "Drawn by hand, for every frame.";
  const number = state.shots.indexOf(shot) + 1;
  const which = state.shots.length > 1 ? `, shot ${number} of ${state.shots.length}` : "";
  const provisional = state.planned ? "" : "; may change until every frame has been looked at";
  return `Automatic${which}${provisional}.`;
}
