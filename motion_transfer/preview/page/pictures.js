// Pictures from the server: fetched while somebody looks at them, kept while there is room.

const KEPT = 300; // pictures; 256 px ones take about 30 MB
const AT_ONCE = 3; // a browser opens six connections to a host, and the state holds one
const RETRY_MS = 1000;

export class PictureStore {
  /** `onArrival` is called whenever a picture or an error has come. */
  constructor(onArrival) {
    this.onArrival = onArrival;
    this.kept = new Map(); // address -> {url} or {error}, the longest unused first
    this.pending = new Map(); // address -> {controller, quick}
    this.wanted = [];
    this.seconds = 0.05; // what a quick picture takes, a running mean
  }

  get(address) {
    const picture = this.kept.get(address);
    if (picture) {
      this.kept.delete(address);
      this.kept.set(address, picture);
    }
    return picture;
  }

  has(address) {
    return this.kept.has(address);
  }

  /**
   * Ask for these, in this order, and for nothing else: what is under way for others is aborted.
   * One quick picture that was passed by may still arrive (all may if `patient`); else a slider
   * that moves faster than pictures come would show none at all.
   */
  want(requests, { patient = false } = {}) {
    this.wanted = requests;
    const addresses = new Set(requests.map((request) => request.address));
    let spared = patient ? Infinity : 1;
    for (const [address, fetching] of this.pending) {
      if (addresses.has(address)) continue;
      if (fetching.quick && spared > 0) spared -= 1;
      else this.#abort(address);
    }
    this.#start();
  }

  #abort(address) {
    this.pending.get(address).controller.abort();
    this.pending.delete(address);
  }

  #start() {
    for (const request of this.wanted) {
      if (this.pending.size >= AT_ONCE) return;
      const { address } = request;
      if (!this.kept.has(address) && !this.pending.has(address)) this.#fetch(request);
    }
  }

  async #fetch({ address, quick }) {
    const controller = new AbortController();
    const fetching = { controller, quick };
    this.pending.set(address, fetching);
    const began = performance.now();
    const picture = await load(address, controller.signal);
    if (this.pending.get(address) !== fetching) return; // aborted
    this.pending.delete(address);
    if (picture) {
      this.#keep(address, picture);
      if (quick) this.seconds += 0.2 * ((performance.now() - began) / 1000 - this.seconds);
      this.onArrival(address);
      this.#start();
    } else {
      setTimeout(() => this.#start(), RETRY_MS);
    }
  }

  #keep(address, picture) {
    this.kept.set(address, picture);
    for (const [oldest, { url }] of this.kept) {
      if (this.kept.size <= KEPT) break;
      this.kept.delete(oldest);
      if (url) URL.revokeObjectURL(url);
    }
  }
}

/** {url}; {error} where there will never be a picture; null where it may come yet. */
async function load(address, signal) {
  try {
    const response = await fetch(address, { signal });
    if (response.ok) return { url: URL.createObjectURL(await response.blob()) };
    // 409: the options have changed meanwhile; the next state brings the new key. 503: closing.
    if ([409, 499, 503].includes(response.status)) return null;
    const { error } = await response.json().catch(() => ({}));
    return { error: error ?? `The server answered ${response.status} ${response.statusText}.` };
  } catch {
    return null; // aborted, or nobody answers
  }
}
