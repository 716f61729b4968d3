"use strict";
// A reader's answers: kept in the browser while they are given, and signed off as JSON.

const STATEMENT =
  "I looked at each pair myself and answered by what I saw; nobody told me what made which view.";

class Sheet {
  constructor(study) {
    this.study = study;
    this.slot = `mt-study-${study.id}`;
    this.kept = true;
    const before = this.read();
    if (before) this.take(before);
    else this.beginAnew();
  }

  /** A new reader, with another order. */
  beginAnew() {
    const bytes = crypto.getRandomValues(new Uint8Array(8));
    const reader = Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
    this.take({ reader, name: "", began: new Date().toISOString(), given: [] });
    this.write();
  }

  take(state) {
    this.state = state;
    this.plan = planTrials(this.study, state.reader);
    this.total = this.plan.trials.length * this.plan.questions.length;
  }

  /** How many questions are answered, which is also the number of the next one. */
  get position() {
    return this.state.given.length;
  }

  get trial() {
    return this.plan.trials[Math.floor(this.position / this.plan.questions.length)];
  }

  get nextTrial() {
    return this.plan.trials[Math.floor(this.position / this.plan.questions.length) + 1];
  }

  get question() {
    return this.plan.questions[this.position % this.plan.questions.length];
  }

  answer(side, ms) {
    this.state.given.push({ side, ms: Math.round(ms) });
    this.write();
  }

  undo() {
    this.state.given.pop();
    this.write();
  }

  rename(name) {
    this.state.name = name;
    this.write();
  }

  /** The answers as a file; `digest` is of all that stands before it, as it is written here. */
  sign() {
    const { reader, name, began, given } = this.state;
    const { questions, trials } = this.plan;
    const answers = trials.map(({ comparison, left, repeat }, number) => {
      const own = given.slice(number * questions.length, (number + 1) * questions.length);
      const choices = Object.fromEntries(questions.map(({ id }, at) => [id, own[at].side]));
      const ms = own.reduce((sum, each) => sum + each.ms, 0);
      return { comparison: comparison.id, left, repeat, choices, ms };
    });
    const content = {
      format: "mt-study-answers-1",
      study: this.study.id,
      reader,
      name: name.trim(),
      statement: STATEMENT,
      began,
      signed: new Date().toISOString(),
      screen: `${innerWidth}x${innerHeight}`,
      questions: questions.map(({ id }) => id),
      answers,
    };
    return { ...content, digest: crc32(JSON.stringify(content)) };
  }

  read() {
    try {
      const state = JSON.parse(localStorage.getItem(this.slot));
      return state && Array.isArray(state.given) && state.reader ? state : null;
    } catch {
      return null;
    }
  }

  write() {
    try {
      localStorage.setItem(this.slot, JSON.stringify(this.state));
    } catch {
      this.kept = false; // a private window, or no room: the answers last as long as the page
    }
  }
}

/** zlib's CRC-32 of a text in UTF-8: enough for accidents, and there where crypto.subtle is not. */
function crc32(text) {
  let remainder = -1;
  for (const byte of new TextEncoder().encode(text)) {
    remainder ^= byte;
    for (let bit = 0; bit < 8; bit++) {
      remainder = (remainder >>> 1) ^ (remainder & 1 ? 0xedb88320 : 0);
    }
  }
  return (~remainder >>> 0).toString(16).padStart(8, "0");
}
