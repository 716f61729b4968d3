"use strict";
// Pictures or videos side by side; videos start together, stay together, and begin again together.

const DRIFT_SECONDS = 0.08; // two frames: less is not seen, and each correction is a jerk

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
    if (view.readyState >= HTMLMediaElement.HAVE_ENOUGH_DATA) resolve();
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

  replay() {
    if (!this.hasVideos) return;
    this.shown.forEach((video) => (video.currentTime = 0));
    this.shown.forEach((video) => video.play().catch(() => {})); // not before the first touch
  }

  #keepTogether([first, second]) {
    if (first.ended || second.ended || second.seeking) return;
    if (Math.abs(first.currentTime - second.currentTime) > DRIFT_SECONDS) {
      second.currentTime = first.currentTime;
    }
  }
}
