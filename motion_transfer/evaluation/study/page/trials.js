"use strict";
// Which pairs a reader sees, in which order and on which sides: all from the reader's random name.

function otherView(view) {
  return view === "a" ? "b" : "a";
}

/** Numbers in [0, 1) that follow from a text: FNV-1a for the seed, then Mulberry32. */
function randomOf(text) {
  let state = 2166136261;
  for (const letter of text) state = Math.imul(state ^ letter.codePointAt(0), 16777619);
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let mixed = Math.imul(state ^ (state >>> 15), state | 1);
    mixed ^= mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61);
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 4294967296;
  };
}

function shuffled(items, random) {
  const order = [...items];
  for (let last = order.length - 1; last > 0; last--) {
    const other = Math.floor(random() * (last + 1));
    [order[last], order[other]] = [order[other], order[last]];
  }
  return order;
}

/**
 * Some pairs of the first half are shown again in the second, with their sides swapped; not the
 * last ones, which a reader would remember.
 */
function planTrials(study, reader) {
  const random = randomOf(`${study.id} ${reader}`);
  const questions = shuffled(study.questions, random);
  const chosen = shuffled(study.comparisons, random).slice(0, study.asked);
  const once = chosen.map((comparison) => {
    return { comparison, left: random() < 0.5 ? "a" : "b", repeat: false };
  });
  const half = Math.ceil(once.length / 2);
  const early = once.slice(0, Math.max(study.repeats, half - 3));
  const again = shuffled(early, random)
    .slice(0, study.repeats)
    .map((trial) => ({ ...trial, left: otherView(trial.left), repeat: true }));
  const trials = [...once.slice(0, half), ...shuffled([...once.slice(half), ...again], random)];
  return { questions, trials };
}
