// Keys that work wherever the focus is, unless what has it needs them itself.

import { byId } from "./dom.js";
import { setIn, setOut } from "./options.js";
import { toggle } from "./player.js";

import { step } from "./timeline.js";
import { viewOfKey } from "./views.js";
import { toggleFullScreen, zoomBy } from "./zoom.js";

const NEEDS_KEYS = "input:not([type=range], [type=checkbox]), select, textarea, video, pre, dialog *";
const NEEDS_SPACE = "button, summary, input:not([type=range])";

export function setUpKeys(looking, choose) {
  byId("show-keys").addEventListener("click", showKeys);
  byId("keys-close").addEventListener("click", () => byId("keys").close());
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) {
      return;
    }
    if (event.key === "Escape" && looking.drawing) looking.look({ drawing: false });
    if (event.target.matches(NEEDS_KEYS)) return;
    if (event.key === "?") return showKeys();
    if (event.key === " " && event.target.matches(NEEDS_SPACE)) return;
    const action = actionOf(event, looking, choose);
    if (!action || !looking.count) return;
    event.preventDefault();
    action();
  });
}

function showKeys() {
  byId("keys").showModal();
}

function actionOf(event, looking, choose) {
  const far = event.shiftKey ? 10 : 1;
  const go = (frame) => () => looking.look({ frame, playing: false });
  const isSlider = event.target.id === "slider";
  const actions = {
    " ": () => toggle(looking),
    ArrowLeft: () => step(looking, -far),
    ArrowRight: () => step(looking, far),
    Home: go(0),
    End: go(looking.count - 1),
    i: () => setIn(looking, choose),
    o: () => setOut(looking, choose),
    f: toggleFullScreen,
    "+": () => zoomBy(looking, 1),
    "=": () => zoomBy(looking, 1), // the same key without Shift
    "-": () => zoomBy(looking, -1),
    0: () => looking.look({ zoom: 1 }),
  };
  // These scroll the page, except where a slider has the focus.
  if (isSlider) {
    Object.assign(actions, {
      ArrowDown: actions.ArrowLeft,
      ArrowUp: actions.ArrowRight,
      PageDown: () => step(looking, -10),
      PageUp: () => step(looking, 10),
    });
  }
  const view = viewOfKey(event.key, looking.state);
  if (view) return () => looking.look({ view });
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  return Object.hasOwn(actions, key) ? actions[key] : null;
}
