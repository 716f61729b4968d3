// The views: what each is made of, and the buttons that choose one.

import { byId, make } from "./dom.js";

const frame = (view) => (index) => `frame/${index}/${view}`;
const still = (view) => () => `still/${view}`;
const photo = (_index, looking) => `source/${looking.state.sources[looking.photoIndex]?.number}`;

// `drafts`: a quick stand-in is there while the picture is under way. `onFrame`: drawn on the
// driver's frame, so that a crop window can be drawn on it. `quick`: comes within a moment.
const PICTURES = {
  result: { path: frame("result"), drafts: true },
  beside: { path: frame("beside"), drafts: true },
  iuv: { path: frame("iuv"), onFrame: true, quick: true },
  pictures: { path: frame("pictures"), onFrame: true, quick: true },
  features: { path: frame("features") },
  source: { path: photo, still: true, quick: true },
  texture: { path: still("texture"), still: true, quick: true },
  map: { path: still("map"), still: true },
};

const VIEWS = [
  ["result", "Result"],
  ["compare", "Compare"],
  ["beside", "Side by side"],
  ["iuv", "IUV"],
  ["pictures", "Clip"],
  ["source", "Person"],
  ["texture", "Partial texture"],
  ["map", "Feature map"],
  ["features", "Feature image"],
];

/** What the method makes on its way: of interest to few, and put away for the others. */
const INSIDE = ["texture", "map", "features"];

export const NAMES = Object.fromEntries(VIEWS);

/** What a view shows, the lowest first: one picture, or two for `compare`. */
export function layersOf(view, state) {
  if (view !== "compare") return [{ name: view, ...PICTURES[view] }];
  const below = driverView(state);
  return [
    { name: below, ...PICTURES[below] },
    { name: "result", ...PICTURES.result },
  ];
}

/** The view of the driver itself. */
export function driverView(state) {
  return state.driver?.pictures ? "pictures" : "iuv";
}

/** Whether the crop window can be shown on this view. */
export function showsDriverFrame(view, looking) {
  if (PICTURES[view]?.onFrame) return looking.isWhole || looking.drawing;
  return (view === "result" || view === "compare") && looking.isWhole;
}

export function isStill(view) {
  return Boolean(PICTURES[view]?.still);
}

/** Whether a view needs somebody to be drawn. */
export function needsPerson(view) {
  return view !== "iuv" && view !== "pictures";
}

/** The row of buttons. Buttons rather than radios: the arrow keys belong to the frames. */
export function setUpViews(looking) {
  const buttons = new Map();
  const inside = make("span", { id: "inside", className: "inside" });
  const toggle = make("button", { id: "show-inside", type: "button", textContent: "Inside" });
  for (const [view, label] of VIEWS) {
    const button = make("button", { type: "button", textContent: label });
    button.addEventListener("click", () => looking.look({ view }));
    buttons.set(view, button);
    if (!INSIDE.includes(view)) byId("views").append(button);
    else inside.append(button);
  }
  byId("views").append(toggle, inside);
  toggle.setAttribute("aria-controls", "inside");
  toggle.addEventListener("click", () => {
    const open = inside.hidden;
    inside.hidden = !open;
    if (!open && INSIDE.includes(looking.view)) looking.look({ view: "result" });
    toggle.setAttribute("aria-expanded", String(open));
  });
  inside.hidden = true;
  toggle.setAttribute("aria-expanded", "false");
  looking.addEventListener("look", () => {
    const { state } = looking;
    for (const [view, button] of buttons) {
      button.setAttribute("aria-pressed", String(view === looking.view));
      const there = needsPerson(view) ? state?.sources.length : state?.driver;
      button.disabled = !there && view !== looking.view;
    }
    toggle.disabled = !state?.sources.length;
    if (INSIDE.includes(looking.view)) {
      inside.hidden = false;
      toggle.setAttribute("aria-expanded", "true");
    }
    buttons.get("pictures").hidden = !state?.driver?.pictures;
  });
}

/** The view of a digit key, or undefined. */
export function viewOfKey(key, state) {
  const there = VIEWS.filter(([view]) => view !== "pictures" || state?.driver?.pictures);
  return there[Number(key) - 1]?.[0];
}
