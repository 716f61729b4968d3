// Speaking with the server. Every address is relative: the token is part of the page's own.

/** Post JSON; returns {ok, status, data}, also where nobody answers (status 0). */
export function post(path, body) {
  return send(path, "application/json", JSON.stringify(body));
}

/** Post a file as it is; returns the same. */
export function postFile(path, file) {
  return send(path, "application/octet-stream", file);
}

async function send(path, type, body) {
  try {
    const headers = { "Content-Type": type };
    const response = await fetch(path, { method: "POST", headers, body });
    const data = await response.json().catch(() => ({}));
    return { ok: response.ok, status: response.status, data: withWords(data, response) };
  } catch {
    return { ok: false, status: 0, data: { error: "The server does not answer." } };
  }
}

function withWords(data, response) {
  if (response.ok || data.error) return data;
  return { ...data, error: `The server answered ${response.status} ${response.statusText}.` };
}

/** Follow the state. `onLost` is called when the connection breaks; the next state ends that. */
export function follow(onState, onLost) {
  const source = new EventSource("events");
  source.onmessage = (message) => onState(JSON.parse(message.data));
  source.onerror = () => {
    onLost();
    // The browser tries again by itself, except after an answer that is no stream of events.
    if (source.readyState === EventSource.CLOSED) setTimeout(() => follow(onState, onLost), 2000);
  };
}
