"use strict";
// Pictures or videos side by side; videos start together, stay together, and begin again together.

const CATCH_UP = 2; // of a drift, a second: what is left after a quarter of one is half
const SPEEDS = [0.5, 1.5];

function isVideo(file) {
  return file.endsWith(".mp4");
}

function makeView(file) {
  if (!isVideo(file)) return Object.assign(new Image(), { src: file, alt: "", draggable: false });
  const video = document.createElement("video");
  return Object.assign(video, { src: file, muted: true, playsInline: true, preload: "auto" });
}

/** Wait until a view can be shown. */
function ready(view) {
  if (view instanceof HTMLImageElement) return view.decode();
  return new Promise((resolve, reject) => {
    if (view.error) reject(new Error("no video"));
    if (view.readyState >= HTMLMediaElement.HAVE_ENOUGH_DATA) resolve();
    view.play().catch(() => {}); // some phones load nothing before
    view.addEventListener("canplaythrough", () => resolve(), { once: true });
    view.addEventListener("error", () => reject(new Error("no video")), { once: true });
  });
}

class Views {
  constructor(frames) {
    this.frames = frames;
    this.shown = [];
    this.files = "";
    this.ahead = new Map(); // the next pair's, loading already
  }

  /** Show a file in each frame; resolves when all can be seen. What is shown already stays. */
  async show(files) {
    if (files.join() === this.files) return;
    this.files = files.join();
    this.shown.forEach((view) => view instanceof HTMLVideoElement && view.pause());
    const views = files.map((file) => this.ahead.get(file) ?? makeView(file));
    this.shown = views;
    this.ahead.clear();
    this.frames.forEach((frame, number) => frame.replaceChildren(views[number]));
    try {
      await Promise.all(views.map(ready));
    } catch (error) {
      this.files = "";
      throw error;
    }
    if (this.shown !== views || !this.hasVideos) return;
    views.forEach((video) => {
      video.addEventListener("ended", () => views.every((each) => each.ended) && this.replay());
    });
    views[0].addEventListener("timeupdate", () => this.#keepTogether(views));
    this.replay();
  }

  prepare(files) {
    files.forEach((file) => this.ahead.set(file, makeView(file)));
  }

  get hasVideos() {
    return this.shown.some((view) => view instanceof HTMLVideoElement);
  }

  /** Begin again together: each when both are back at the beginning. */
  async replay() {
    const views = this.shown;
    if (!this.hasVideos) return;
    await Promise.all(views.map(rewind));
    if (this.shown !== views) return;
    views.forEach((video) => video.play().catch(() => {})); // not before the first touch
  }

  /** By speed, as each jump would be a jerk. */
  #keepTogether([first, second]) {
    const drift = second.ended || first.ended ? 0 : first.currentTime - second.currentTime;
    second.playbackRate = Math.min(SPEEDS[1], Math.max(SPEEDS[0], 1 + CATCH_UP * drift));
  }
}

function rewind(video) {
  video.pause();
  if (video.currentTime === 0) return null;
  return new Promise((resolve) => {
    video.addEventListener("seeked", resolve, { once: true });
    video.currentTime = 0;
  });
}
