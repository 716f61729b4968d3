// Small helpers around the document.

export function byId(id) {
  return document.getElementById(id);
}

export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Set what differs only: an element that is written to anew loses its selection and its focus. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** One call in the next animation frame, however often it is asked for until then. */
export function oncePerFrame(work) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    const run = () => {
      if (!asked) return;
      asked = false;
      work();
    };
    // A tab in the background gets no animation frames, but has to keep up all the same.
    if (document.hidden) setTimeout(run, 50);
    else requestAnimationFrame(run);
  };
}

/** Tell those who listen rather than look. The same words twice are said twice. */
export function say(words) {
  const said = byId("said");
  said.textContent = "";
  setTimeout(() => (said.textContent = words), 50);
}

/** [1, 2, 3, 7] -> [[1, 4], [7, 8]]: half-open ranges of sorted numbers. */
export function toRanges(numbers) {
  const ranges = [];
  for (const number of numbers) {
    const last = ranges.at(-1);
    if (last && last[1] === number) last[1] += 1;
    else ranges.push([number, number + 1]);
  }
  return ranges;
}

/** "30000/1001" -> 29.97; null for what is no rate. */
export function rateOf(words) {
  const [above, below = "1"] = String(words).split("/");
  const rate = Number(above) / Number(below);
  return Number.isFinite(rate) && rate > 0 ? rate : null;
}

/** Numbers that can be felt: ", about 2 min left"; nothing where it is not known yet. */
export function timeLeft({ seconds_left: seconds }) {
  if (seconds == null) return "";
  if (seconds < 8) return ", a few seconds left";
  if (seconds < 90) return `, about ${Math.ceil(seconds / 10) * 10} s left`;
  if (seconds < 5400) return `, about ${Math.round(seconds / 60)} min left`;
  return `, about ${(seconds / 3600).toFixed(1)} h left`;
}

export function plural(count, word) {
  return `${count} ${word}${count === 1 ? "" : "s"}`;
}
