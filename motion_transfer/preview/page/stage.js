// The picture: what is asked of the server for where somebody looks, and what is shown meanwhile.

import { byId, oncePerFrame, say, setText } from "./dom.js";
import { PictureStore } from "./pictures.js";
import { workWords } from "./notes.js";
import { isStill, layersOf, NAMES, needsPerson, showsDriverFrame } from "./views.js";

const SETTLED_MS = 120; // without a move; only then is the network put to work
const AHEAD = 5; // pictures fetched ahead while playing

export class Stage {
  constructor(looking) {
    this.looking = looking;
    this.store = new PictureStore(() => this.draw());
    this.draw = oncePerFrame(() => this.#draw());
    this.listeners = [];
    looking.addEventListener("look", () => {
      this.#ask();
      this.draw();
    });
  }

  /** Address of a layer's picture in a frame. */
  address(layer, frame, draft = false) {
    const { key } = this.looking.state;
    const query = `key=${encodeURIComponent(key)}${draft ? "&draft=1" : ""}`;
    return `${layer.path(frame, this.looking)}?${query}`;
  }

  /** Whether a frame is there, as it is seen when one stops at it. */
  hasFrame(frame) {
    if (isStill(this.looking.view)) return false;
    const layers = layersOf(this.looking.view, this.looking.state);
    return layers.every((layer) => this.store.has(this.address(layer, frame)));
  }

  #drafts(layer) {
    return layer.drafts && this.looking.state.options.renderer !== "texture";
  }

  #isQuick(layer) {
    return layer.quick || this.looking.state.options.renderer === "texture";
  }

  #ask() {
    clearTimeout(this.settling);
    const { state, playing, view, frame } = this.looking;
    if (!state || (!state.driver && !isStill(view))) return this.store.want([]);
    if (needsPerson(view) && !state.sources.length) return this.store.want([]);
    if (playing) return this.store.want(this.#askAhead(), { patient: true });
    const calm = this.looking.movedAt + SETTLED_MS - performance.now();
    if (calm > 0) this.settling = setTimeout(() => this.#ask(), calm);
    const layers = layersOf(view, state);
    const drafts = layers
      .filter((layer) => this.#drafts(layer))
      .filter((layer) => !this.store.has(this.address(layer, frame)))
      .map((layer) => ({ address: this.address(layer, frame, true), quick: true }));
    const finals = layers
      .filter((layer) => this.#isQuick(layer) || calm <= 0)
      .map((layer) => ({ address: this.address(layer, frame), quick: this.#isQuick(layer) }));
    return this.store.want([...drafts, ...finals]);
  }

  /** The next frames in time; every second only, or fewer, where pictures come too slowly. */
  #askAhead() {
    const { state, view, frame, rate } = this.looking;
    const layers = layersOf(view, state);
    const late = this.store.seconds * rate * layers.length;
    const stride = Math.max(1, Math.ceil(late / 3));
    const next = Math.ceil((frame + Math.min(late, 10)) / stride) * stride;
    const frames = [frame, ...Array.from({ length: AHEAD }, (_, step) => next + step * stride)];
    return frames.map((index) => this.#loop(index)).flatMap((index) =>
      layers.map((layer) => this.#whilePlaying(layer, index)).filter((request) => request),
    );
  }

  #whilePlaying(layer, frame) {
    const final = { address: this.address(layer, frame), quick: this.#isQuick(layer) };
    if (!this.#drafts(layer)) return final;
    const draft = { address: this.address(layer, frame, true), quick: true };
    // Where there can be no draft, the picture itself is waited for.
    return this.store.get(draft.address)?.error ? final : draft;
  }

  #loop(frame) {
    const [start, stop] = this.looking.range;
    return frame < stop ? frame : start + ((frame - start) % (stop - start));
  }

  /** The best there is of a layer: {picture, draft}. */
  #best(layer, frame) {
    const final = this.store.get(this.address(layer, frame));
    if (!this.#drafts(layer)) return { picture: final, draft: false };
    const draft = this.store.get(this.address(layer, frame, true));
    // Motion is judged by pictures of one kind: while playing, a draft goes before.
    const usable = draft && !draft.error;
    if (usable && (this.looking.playing || !final)) return { picture: draft, draft: true };
    return { picture: final, draft: false };
  }

  #draw() {
    const { state, view, frame } = this.looking;
    const isEmpty = Boolean(state) && needsPerson(view) && !state.sources.length;
    byId("welcome").hidden = !isEmpty;
    if (isEmpty) return this.#showTrouble("");
    const why = this.#whyNothing();
    if (why !== null) return this.#showTrouble(why);
    const layers = layersOf(view, state);
    const best = layers.map((layer) => this.#best(layer, frame));
    const broken = best.find(({ picture }) => picture?.error);
    if (broken) return this.#showTrouble(broken.picture.error);
    byId("stage").classList.toggle("waiting", !best.every(({ picture }) => picture));
    if (!best.every(({ picture }) => picture)) return this.#showPassing(layers);
    this.#show(layers, best, frame);
    return undefined;
  }

  #whyNothing() {
    const { state, view } = this.looking;
    if (!state) return "";
    if (state.error) return state.error;
    if (isStill(view) ? state.source : state.driver) return null;
    if (isStill(view)) return "Opening the photo…";
    return state.work ? `${workWords(state.work)}.` : "Opening the motion…";
  }

  /** While frames rush by, show the last that came: a slider that is dragged shows motion too. */
  #showPassing(layers) {
    if (!this.looking.playing && performance.now() - this.looking.movedAt > 400) return;
    for (let back = 1; back <= 12; back += 1) {
      for (const frame of [this.looking.frame - back, this.looking.frame + back]) {
        const best = layers.map((layer) => this.#best(layer, frame));
        if (best.every(({ picture }) => picture?.url)) return this.#show(layers, best, frame);
        if (this.looking.playing) break; // backwards only: time does not run to and fro
      }
    }
  }

  #show(layers, best, frame) {
    const images = layers.length === 2 ? [byId("base"), byId("over")] : [byId("over")];
    // What the result does not show of the driver's frame is not shown of the driver either, so that
    // a person stands in the same place in every view.
    const isCut = layers.length === 1 && layers[0].onFrame && !showsDriverFrame(layers[0].name, this.looking);
    byId("base").hidden = layers.length < 2;
    byId("over").classList.toggle("cut", Boolean(isCut));
    layers.forEach((layer, index) => {
      const image = images[index];
      image.hidden = false;
      if (image.getAttribute("src") !== best[index].picture.url) image.src = best[index].picture.url;
      image.alt = layer.still ? NAMES[layer.name] : `${NAMES[layer.name]}, driver frame ${frame}`;
      Object.assign(image.dataset, { view: layer.name, frame });
    });
    byId("trouble").hidden = true;
    byId("frame").hidden = false;
    this.#fit(isCut);
    this.#place(byId("base"), frame, !this.looking.isWhole);
    this.#place(byId("over"), frame, isCut);
    this.#label(best.at(-1), layers.at(-1));
    this.#tell();
  }

  /** The box has the shape of its upper picture, known once that is decoded. */
  #fit(isCut) {
    const over = byId("over");
    const apply = () => {
      if (!over.naturalWidth) return;
      const ratio = isCut ? 1 : over.naturalWidth / over.naturalHeight;
      byId("frame").style.setProperty("--ratio", ratio);
      byId("frame").classList.toggle("small", over.naturalWidth < 96);
    };
    if (over.complete) apply();
    over.onload = apply;
  }

  /** Where the result shows a square only, the driver's frame is moved so that both agree. */
  #place({ style }, frame, isCut) {
    const { state } = this.looking;
    const shot = state.shots?.find(({ start, stop }) => start <= frame && frame < stop);
    const cut = isCut && shot && state.driver;
    const share = (length) => `${(100 * length) / shot.side}%`;
    style.left = cut ? share(-shot.x) : "0";
    style.top = cut ? share(-shot.y) : "0";
    style.width = cut ? share(state.driver.width) : "100%";
    style.height = cut ? share(state.driver.height) : "100%";
  }

  #label({ draft }, layer) {
    const { state, photoIndex } = this.looking;
    const which = byId("which");
    which.hidden = layer.name !== "source" || state.sources.length < 2;
    const leads = photoIndex === 0 ? " · leads" : "";
    const name = state.sources[photoIndex]?.name;
    setText(which, `${photoIndex + 1} of ${state.sources.length} · ${name}${leads}`);
    const badge = byId("quality");
    badge.hidden = !layer.drafts;
    const kind = draft || this.looking.state.options.renderer === "texture" ? "draft" : "network";
    badge.dataset.kind = kind;
    const wait = draft && !this.looking.playing;
    badge.classList.toggle("busy", wait);
    setText(badge, wait ? "draft · the network's is under way" : kind);
  }

  #showTrouble(words) {
    const { state, view, frame } = this.looking;
    byId("frame").hidden = true;
    byId("quality").hidden = true;
    byId("which").hidden = true;
    byId("stage").classList.remove("waiting");
    const trouble = byId("trouble");
    trouble.hidden = !words;
    trouble.dataset.frame = frame;
    const isPart = state?.driver && !state.error && !isStill(view) && words;
    const isNew = trouble.textContent !== words;
    setText(trouble, words);
    if (isPart && isNew && !this.looking.playing) say(words);
    this.#tell();
  }

  /** Others draw what depends on what is there. */
  #tell() {
    for (const listener of this.listeners) listener();
  }
}
