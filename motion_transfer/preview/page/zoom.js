// How large the picture is: it fits, or is larger and scrolls, or has the whole screen.

import { byId } from "./dom.js";

const STEPS = [1, 1.5, 2, 3, 4, 6, 8]; // times as large as it fits

export function setUpZoom(looking) {
  byId("zoom-in").addEventListener("click", () => zoomBy(looking, 1));
  byId("zoom-out").addEventListener("click", () => zoomBy(looking, -1));
  byId("full").addEventListener("click", toggleFullScreen);
  byId("full").hidden = !document.fullscreenEnabled; // phones' browsers may have none
  looking.addEventListener("look", () => {
    const { zoom, state } = looking;
    const scroller = byId("scroller");
    if (scroller.dataset.zoom !== String(zoom)) apply(scroller, zoom);
    byId("zoom-in").disabled = !state?.driver || zoom === STEPS.at(-1);
    byId("zoom-out").disabled = !state?.driver || zoom === STEPS[0];
    byId("full").disabled = !state?.driver;
  });
}

export function zoomBy(looking, steps) {
  const step = STEPS.indexOf(looking.zoom) + steps;
  looking.look({ zoom: STEPS[Math.max(0, Math.min(step, STEPS.length - 1))] });
}

export function toggleFullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else byId("viewer").requestFullscreen();
}

/** What was in the middle stays there. */
function apply(scroller, zoom) {
  const middle = (start, size, all) => (start + size / 2) / all;
  const x = middle(scroller.scrollLeft, scroller.clientWidth, scroller.scrollWidth);
  const y = middle(scroller.scrollTop, scroller.clientHeight, scroller.scrollHeight);
  scroller.dataset.zoom = zoom;
  byId("frame").style.setProperty("--zoom", zoom);
  scroller.scrollLeft = x * scroller.scrollWidth - scroller.clientWidth / 2;
  scroller.scrollTop = y * scroller.scrollHeight - scroller.clientHeight / 2;
}
