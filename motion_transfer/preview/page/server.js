// Speaking with the server. Every address is relative: the token is part of the page's own.

/** Post JSON; returns {ok, status, data}, also where nobody answers (status 0). */
export async function post(path, body) {
  try {
    const headers = { "Content-Type": "application/json" };
    const response = await fetch(path, { method: "POST", headers, body: JSON.stringify(body) });
    const data = await response.json().catch(() => ({}));
    return { ok: response.ok, status: response.status, data: withWords(data, response) };
  } catch {
    return nobody();
  }
}

/** Post and give the answer's data; throws what to say where it was refused. */
export async function ask(path, body) {
  return dataOf(await post(path, body));
}

/**
 * Send a file as it is; gives what it is known by, throws what to say.
 * `told` is called with the share that is sent, from 0 to 1, of which fetch says nothing.
 */
export function sendFile(purpose, drop, file, told) {
  const request = new XMLHttpRequest();
  request.open("POST", `files/${purpose}/${drop}/${encodeURIComponent(file.name)}`);
  request.setRequestHeader("Content-Type", "application/octet-stream");
  request.responseType = "json";
  request.upload.onprogress = ({ loaded, total }) => told(total ? loaded / total : 0);
  return new Promise((resolve, reject) => {
    request.onerror = () => reject(new Error(nobody().data.error));
    request.onload = () => {
      const ok = request.status < 300;
      const data = withWords(request.response ?? {}, { ok, status: request.status, statusText: "" });
      if (ok) resolve(data.known);
      else reject(new Error(data.error));
    };
    request.send(file);
  });
}

function dataOf({ ok, data }) {
  if (!ok) throw new Error(data.error);
  return data;
}

function nobody() {
  return { ok: false, status: 0, data: { error: "The server does not answer." } };
}

function withWords(data, response) {
  if (response.ok || data.error) return data;
  return { error: `The server answered ${response.status} ${response.statusText}.` };
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
