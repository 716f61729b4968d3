// Files that are dragged over the page: it says what they can be, wherever the pointer is.

import { byId } from "./dom.js";

const STILL_HERE_MS = 700; // browsers tell of what is dragged every 350 ms, give or take 200

/** `takers`: for each place that files can be dropped on, what takes them. */
export function setUpDrops(looking, takers) {
  const drops = byId("drops");
  let leaving;
  const over = (target) => {
    drops.hidden = target === null;
    for (const place of drops.children) place.classList.toggle("over", place === target);
  };
  const isFiles = (event) => event.dataTransfer?.types.includes("Files");
  const begin = () => {
    const isEmpty = !looking.state?.sources.length;
    byId("drop-add").hidden = isEmpty;
    byId("drop-garment").hidden = isEmpty;
    byId("drop-background").hidden = isEmpty;
  };
  document.addEventListener("dragover", (event) => {
    if (!isFiles(event)) return;
    event.preventDefault();
    if (drops.hidden) begin();
    const place = event.target.closest?.("[data-drop]");
    event.dataTransfer.dropEffect = place ? "copy" : "none";
    over(place ?? drops);
    clearTimeout(leaving); // "dragleave" comes for every element on the way, this does not
    leaving = setTimeout(over, STILL_HERE_MS, null);
  });
  // Where none of them is hit, the browser would leave the page for the file.
  document.addEventListener("drop", (event) => {
    if (!isFiles(event)) return;
    event.preventDefault();
    over(null);
    const place = event.target.closest?.("[data-drop]");
    const files = [...event.dataTransfer.files];
    if (place && files.length) takers[place.dataset.drop](files);
  });
}
