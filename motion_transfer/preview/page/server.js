// Speaking with the server. Every address is relative: the token is part of the page's own.

/** Post JSON; returns {ok, status, data}, also where nobody answers (status 0). */
export async function post(path, body) {
  try {
    const response = await fetch(path, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
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
