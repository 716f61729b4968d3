// What the server says, and where somebody looks: the one thing that all parts of the page share.

import { rateOf } from "./dom.js";

export class Looking extends EventTarget {
  state = null;
  frame = 0;
  motion = null; // the number of the one that the frame is of
  view = "result";
  photo = null; // the number of the source that its view shows; null: the one that leads
  playing = false;
  drawing = false; // a crop window is being drawn
  zoom = 1; // of the picture, to how it fits
  movedAt = 0; // ms, when the frame was last changed
  reconnecting = false; // the next state is newer, whatever its number

  /** Take the server's state; events `state`, then `look`. */
  receive(state) {
    // Answers to what was posted and the stream of events may overtake each other.
    if (this.state && state.revision < this.state.revision && !this.reconnecting) return;
    this.reconnecting = false;
    this.state = state;
    // While the same motion is read again, as another choice needs it, nobody loses their place.
    if (state.driver && state.motion !== this.motion) {
      this.motion = state.motion;
      this.frame = state.options.frames?.[0] ?? 0;
    }
    this.frame = this.clamp(this.frame);
    if (!state.sources.some(({ number }) => number === this.photo)) this.photo = null;
    this.dispatchEvent(new Event("state"));
    this.dispatchEvent(new Event("look"));
  }

  /** Look elsewhere: any of frame, view, photo, playing, drawing; event `look`. */
  look(changes) {
    if ("frame" in changes) {
      changes = { ...changes, frame: this.clamp(changes.frame) };
      if (changes.frame !== this.frame) this.movedAt = performance.now();
    }
    Object.assign(this, changes);
    this.dispatchEvent(new Event("look"));
  }

  get count() {
    return this.state?.driver?.frame_count ?? 0;
  }

  /** In and out, half-open. */
  get range() {
    return this.state?.options.frames ?? [0, this.count];
  }

  get rate() {
    const { options, driver } = this.state ?? {};
    return rateOf(options?.frame_rate) ?? rateOf(driver?.frame_rate) ?? 30;
  }

  /** The crop window of the frame looked at. */
  get shot() {
    const shots = this.state?.shots ?? [];
    return shots.find(({ start, stop }) => start <= this.frame && this.frame < stop) ?? null;
  }

  /** Which of the sources is looked at, from 0. */
  get photoIndex() {
    const index = this.state.sources.findIndex(({ number }) => number === this.photo);
    return Math.max(index, 0);
  }

  /** Whether a source is the one that the view `source` shows. */
  isLookedAt(number) {
    return this.state.sources[this.photoIndex]?.number === number;
  }

  /** Whether there is somebody, and a motion: what it takes to draw. */
  get isReady() {
    return Boolean(this.state?.sources.length && this.state.driver);
  }

  /** Whether the result shows the driver's whole frame, not the square around the person. */
  get isWhole() {
    const { size, driver } = this.state;
    if (!size || !driver) return true;
    const near = (a, b) => Math.abs(a - b) <= 1; // a frame may be made even
    return near(size.width, driver.width) && near(size.height, driver.height);
  }

  clamp(frame) {
    if (!this.count) return this.frame; // that of a motion which is not there at the moment
    return Math.max(0, Math.min(Math.round(frame) || 0, this.count - 1));
  }
}
