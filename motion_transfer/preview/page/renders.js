// What was rendered, is being rendered, or waits: how far it is, and the file when it is there.

import { byId, make, plural, say, setText, timeLeft } from "./dom.js";
import { post } from "./server.js";

const PICTURES = [".gif", ".png", ".webp", ".apng"];
const FILMS = [".mp4", ".mov", ".webm", ".mkv"];
const LOOKED = { scan: " looked at", estimate: " searched for the person", track: " searched for the person" };

export function setUpRenders(looking) {
  byId("cinema-close").addEventListener("click", () => byId("cinema").close());
  byId("cinema").addEventListener("close", () => {
    byId("film").pause();
    byId("film").removeAttribute("src");
    byId("film").load(); // lets go of the file
  });
  const before = new Map(); // number -> status
  looking.addEventListener("state", () => {
    const { renders } = looking.state;
    showRenders(looking, renders);
    for (const render of renders) {
      const changed = before.has(render.number) && before.get(render.number) !== render.status;
      if (changed && render.status !== "running") say(`${render.name}: ${wordsOf(render)}`);
      before.set(render.number, render.status);
    }
  });
}

/** The newest first; an item stays the same element, and its buttons keep the focus. */
function showRenders(looking, renders) {
  const list = byId("renders");
  list.hidden = !renders.length;
  const items = new Map([...list.children].map((item) => [Number(item.dataset.number), item]));
  const wanted = renders.toReversed().map((render) => {
    const item = items.get(render.number) ?? makeItem(looking, render.number);
    showItem(item, render);
    return item;
  });
  for (const item of list.children) if (!wanted.includes(item)) item.remove();
  for (const [index, item] of wanted.entries()) {
    if (list.children[index] !== item) list.insertBefore(item, list.children[index] ?? null);
  }
}

function makeItem(looking, number) {
  const tell = (what) => () => post(`renders/${number}/${what}`, {});
  const button = (name, words, act) => {
    const element = make("button", { type: "button", textContent: words });
    element.dataset.does = name;
    element.addEventListener("click", act);
    return element;
  };
  const download = make("a", { className: "button", textContent: "Download" });
  download.dataset.does = "download";
  Object.assign(download, { href: `renders/${number}/file?download=1`, download: "" });
  const find = () => looking.state.renders.find((render) => render.number === number);
  const item = make(
    "li",
    {},
    make("span", { className: "render-name" }),
    make("progress", { className: "wide" }),
    make("p", { className: "line quiet" }),
    make(
      "div",
      { className: "row" },
      button("watch", "Watch", () => {
        looking.look({ playing: false });
        watch(find());
      }),
      download,
      button("stop", "Stop", tell("stop")),
      button("resume", "Resume", tell("resume")),
      button("remove", "Forget", tell("remove")),
    ),
  );
  item.dataset.number = number;
  return item;
}

function showItem(item, render) {
  const { status, name, output, done, total } = render;
  item.dataset.status = status;
  setText(item.querySelector(".render-name"), name);
  item.title = output;
  const bar = item.querySelector("progress");
  bar.hidden = status !== "running";
  bar.setAttribute("aria-label", `Rendering ${name}`);
  if (total) Object.assign(bar, { max: total, value: done });
  else bar.removeAttribute("value");
  const words = item.querySelector("p");
  words.classList.toggle("fault", status === "failed");
  setText(words, wordsOf(render));
  const shown = {
    watch: status === "done" && !render.gone && (isFilm(name) || isPicture(name)),
    download: status === "done" && render.bytes != null,
    stop: status === "running" || status === "waiting",
    resume: status === "stopped" || status === "failed",
    remove: status !== "running" && status !== "waiting",
  };
  for (const control of item.querySelectorAll("[data-does]")) {
    const focused = document.activeElement === control;
    control.hidden = !shown[control.dataset.does];
    control.setAttribute("aria-label", `${control.textContent} ${name}`);
    // What it did is done: the next thing to do is at hand.
    if (focused && control.hidden) item.querySelector("[data-does]:not([hidden])")?.focus();
  }
}

function wordsOf(render) {
  const { status, stage, done, total, message, seconds, bytes, gone } = render;
  const time = seconds == null ? "" : ` in ${seconds.toFixed(1)} s`;
  const size = bytes == null ? "" : `, ${sizeOf(bytes)}`;
  const frames = total ? `${done} of ${plural(total, "frame")}${LOOKED[stage] ?? ""}` : "Beginning…";
  return {
    waiting: "Waits for its turn.",
    running: `${frames}${timeLeft(render)}`,
    done: `Done${time}${size}. ${gone ? "The file is no longer there." : message}`.trim(),
    failed: message || "Rendering failed.",
    stopped: message || "Stopped. Resume to go on where it was.",
  }[status];
}

function sizeOf(bytes) {
  if (bytes < 1e6) return `${Math.max(1, Math.round(bytes / 1e3))} kB`;
  return bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
}

function isFilm(name) {
  return FILMS.some((suffix) => name.toLowerCase().endsWith(suffix));
}

function isPicture(name) {
  return PICTURES.some((suffix) => name.toLowerCase().endsWith(suffix));
}

/** Show what was rendered, as far as a browser can. */
function watch(render) {
  const { name, number, output, bytes, seconds } = render;
  const address = `renders/${number}/file?of=${bytes}-${seconds}`;
  const [film, still] = [byId("film"), byId("still")];
  const cannot = () => {
    film.hidden = still.hidden = true;
    setText(byId("cinema-words"), `This browser cannot show it; it lies at ${output}.`);
  };
  setText(byId("cinema-title"), name);
  setText(byId("cinema-words"), `${wordsOf(render)} It lies at ${output}.`);
  byId("cinema-download").href = `renders/${number}/file?download=1`;
  film.hidden = !isFilm(name);
  still.hidden = film.hidden ? !isPicture(name) : true;
  film.onerror = () => film.getAttribute("src") && cannot();
  still.onerror = cannot;
  if (!film.hidden) {
    film.src = address;
    film.play().catch(() => {}); // where it may not start by itself, there are controls
  } else {
    still.src = address;
  }
  if (!byId("cinema").open) byId("cinema").showModal();
}
