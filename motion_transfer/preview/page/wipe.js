// The handle between driver and result in the view `compare`.

import { byId } from "./dom.js";
import { driverView } from "./views.js";

const STEP = 2; // percent of the picture's width

export function setUpWipe(looking) {
  const [handle, frame] = [byId("wipe"), byId("frame")];
  let percent = 50;

  function move(to) {
    percent = Math.max(0, Math.min(100, Math.round(to)));
    show();
  }

  function show() {
    const on = looking.view === "compare" && Boolean(looking.state?.driver);
    handle.hidden = !on;
    handle.style.left = `${percent}%`;
    handle.setAttribute("aria-valuenow", String(percent));
    handle.setAttribute("aria-valuetext", `${percent} percent driver, the rest result`);
    byId("over").style.clipPath = on ? `inset(0 0 0 ${percent}%)` : "";
    const sides = byId("sides");
    sides.hidden = !on;
    if (on) sides.textContent = `${driverView(looking.state) === "iuv" ? "IUV" : "driver"} | result`;
  }

  function follow(event) {
    const box = frame.getBoundingClientRect();
    move((100 * (event.clientX - box.left)) / box.width);
  }

  frame.addEventListener("pointerdown", (event) => {
    if (looking.view !== "compare" || looking.drawing || event.button !== 0) return;
    event.preventDefault(); // an image would be dragged along
    frame.setPointerCapture(event.pointerId);
    handle.focus({ preventScroll: true });
    follow(event);
    frame.addEventListener("pointermove", follow);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    frame.addEventListener(end, () => frame.removeEventListener("pointermove", follow));
  }

  handle.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 5 * STEP : STEP;
    const to = {
      ArrowLeft: percent - step,
      ArrowDown: percent - step,
      ArrowRight: percent + step,
      ArrowUp: percent + step,
      PageDown: percent - 10,
      PageUp: percent + 10,
      Home: 0,
      End: 100,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    move(to);
  });
  looking.addEventListener("look", show);
}
