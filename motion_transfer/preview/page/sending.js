// Files on their way: sent one after the other, with words for how far they are.

import { byId, say, setText } from "./dom.js";
import { sendFile } from "./server.js";

/**
 * One place of the page that takes files: a line of words, and one for what went wrong.
 * Its work is done one piece at a time; `onChange` is called when one begins or ends.
 */
export class Taker {
  constructor(purpose, words, fault, onChange = () => {}) {
    Object.assign(this, { purpose, words: byId(words), fault: byId(fault), onChange });
    this.busy = null; // what is under way, in words
  }

  /** Do one piece of work, which may throw what to say; while it lasts there is no other. */
  async work(words, task) {
    if (this.busy) return;
    this.#show("");
    this.tell(words);
    try {
      await task();
    } catch (error) {
      this.#show(error.message);
      say(error.message);
    }
    this.tell(null);
  }

  /** Send files that came together, which lie together then: a photo finds its IUV. */
  async send(files) {
    const known = [];
    const drop = Date.now();
    for (const [index, file] of files.entries()) {
      const which = files.length > 1 ? ` (${index + 1} of ${files.length})` : "";
      const told = (share) => this.tell(`Sending ${file.name}${which}, ${Math.floor(100 * share)} %`);
      told(0);
      known.push(await sendFile(this.purpose, drop, file, told));
    }
    return known;
  }

  tell(words) {
    this.busy = words;
    this.onChange();
  }

  #show(words) {
    this.fault.hidden = !words;
    setText(this.fault, words);
  }
}

/** Open the browser's dialog; `take` gets the files that were chosen in it. */
export function choosingFiles(input, take) {
  let chosen = take;
  input.addEventListener("change", () => input.files.length && chosen([...input.files]));
  return (other = take) => {
    chosen = other;
    input.value = ""; // the same file may be chosen again
    input.click();
  };
}
