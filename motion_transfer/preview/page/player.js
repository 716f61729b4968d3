// Playing: the clock goes on at the frame rate, whether pictures come in time or not.

import { byId, setText } from "./dom.js";

export function setUpPlayer(looking) {
  const button = byId("play");
  let began = null; // {time in ms, frame}: where the clock was started
  let shown = -1;

  function tick(now) {
    if (!looking.playing || !looking.count) return;
    // Somebody went elsewhere, or the rate is another: the clock starts from here.
    if (!began || looking.frame !== shown || began.rate !== looking.rate) {
      began = { time: now, frame: looking.frame, rate: looking.rate };
    }
    const passed = Math.floor(((now - began.time) / 1000) * looking.rate);
    shown = inLoop(looking, began.frame, passed);
    if (shown !== looking.frame) looking.look({ frame: shown });
    requestAnimationFrame(tick);
  }

  let wasPlaying = false;
  looking.addEventListener("look", () => {
    setText(button, looking.playing ? "Pause" : "Play");
    button.disabled = looking.count < 2 || !looking.state;
    if (looking.playing && !wasPlaying) {
      began = null;
      shown = looking.frame;
      requestAnimationFrame(tick);
    }
    wasPlaying = looking.playing;
  });
  button.addEventListener("click", () => toggle(looking));
}

export function toggle(looking) {
  if (looking.count < 2) return;
  const [start, stop] = looking.range;
  const frame = !looking.playing && looking.frame >= stop - 1 ? start : looking.frame;
  looking.look({ playing: !looking.playing, frame });
}

/** From in to out again and again, once inside; frames before it are a run-up. */
function inLoop(looking, frame, passed) {
  const [start, stop] = looking.range;
  const to = frame + passed;
  return to < stop ? to : start + ((to - start) % (stop - start));
}
