"use strict";
// The page of a study: its three screens, its keys, and where the answers go.

const LOCK_MS = 250; // after an answer, so that a double click is not two
const byId = (id) => document.getElementById(id);
const sheet = new Sheet(STUDY);
const sides = [...document.querySelectorAll(".view")];
const views = new Views(sides.map((side) => side.querySelector(".frame")));
const collector = document.documentElement.dataset.answers; // where `mt` takes answers, if it serves
let since = 0;
let saved = false;

function filesOf({ comparison, left }) {
  return [comparison[left], comparison[otherView(left)]];
}

/** Whether an answer is taken: not while the views are loading. */
function isOpen() {
  return byId("views").ariaBusy === "false";
}

function setOpen(open) {
  byId("views").ariaBusy = String(!open);
}

function showScreen(name) {
  document.querySelectorAll("main").forEach((screen) => (screen.hidden = screen.id !== name));
}

async function show() {
  setOpen(false);
  byId("trouble").textContent = "";
  if (sheet.position >= sheet.total) {
    showSigning();
    return;
  }
  const { position, total, trial, question, nextTrial } = sheet;
  showScreen("asking");
  byId("progress").max = total;
  byId("progress").value = position;
  byId("count").textContent = `${position + 1} of ${total}`;
  byId("question").textContent = question.words;
  byId("back").disabled = position === 0;
  byId("source").hidden = !trial.comparison.source;
  if (trial.comparison.source) byId("source").querySelector("img").src = trial.comparison.source;
  byId("question").focus({ preventScroll: true }); // no button keeps a focus that Enter would press
  try {
    await Promise.all([views.show(filesOf(trial)), new Promise((go) => setTimeout(go, LOCK_MS))]);
  } catch {
    byId("trouble").textContent =
      "This pair cannot be shown. Is the folder media complete, beside the page? Then reload.";
    return;
  }
  if (sheet.position !== position) return; // somebody went back meanwhile
  byId("replay").hidden = !views.hasVideos;
  if (nextTrial) views.prepare(filesOf(nextTrial));
  if (!sheet.kept) {
    byId("trouble").textContent = "This browser keeps nothing: do not close the page until the end.";
  }
  since = performance.now();
  setOpen(true);
}

function answer(side) {
  if (!isOpen()) return;
  sheet.answer(side, performance.now() - since);
  saved = false;
  const chosen = sides.find((each) => each.dataset.side === side);
  chosen.classList.add("chosen");
  setTimeout(() => chosen.classList.remove("chosen"), LOCK_MS);
  show();
}

function goBack() {
  if (sheet.position === 0) return;
  sheet.undo();
  show();
}

function showSigning() {
  showScreen("signing");
  byId("name").value = sheet.state.name;
  byId("statement").textContent = STATEMENT;
  byId("agreed").checked = false;
  byId("send").hidden = !collector;
  byId("download").classList.toggle("main", !collector);
  byId("next-reader").hidden = !saved;
  byId("told").textContent = "";
  allow();
  byId("signing").querySelector("h1").focus();
}

function allow() {
  for (const id of ["send", "download", "copy"]) byId(id).disabled = !byId("agreed").checked;
}

function tell(words, done = true) {
  byId("told").textContent = words;
  saved ||= done;
  byId("next-reader").hidden = !saved;
}

function signedText() {
  return `${JSON.stringify(sheet.sign(), null, 1)}\n`;
}

function download() {
  const name = `answers-${STUDY.id.slice(0, 6)}-${sheet.state.reader.slice(0, 6)}.json`;
  const address = URL.createObjectURL(new Blob([signedText()], { type: "application/json" }));
  const link = Object.assign(document.createElement("a"), { href: address, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
  tell(`Saved as ${name} among your downloads. Please send that file to whoever asked you.`);
}

async function copy() {
  try {
    await navigator.clipboard.writeText(signedText());
    tell("Copied. Please paste it into a message to whoever asked you.");
  } catch {
    tell("This browser does not let the page copy; save them instead.", false);
  }
}

async function send() {
  byId("send").disabled = true;
  try {
    const headers = { "Content-Type": "application/json" };
    const response = await fetch(collector, { method: "POST", headers, body: JSON.stringify(sheet.sign()) });
    if (!response.ok) throw new Error((await response.json()).error);
    tell("Sent. That is all; thank you.");
  } catch (error) {
    tell(`Not sent (${error.message}); save them instead.`, false);
  }
  allow();
}

function setUpKeys() {
  const actions = {
    ArrowLeft: () => answer("left"),
    1: () => answer("left"),
    ArrowRight: () => answer("right"),
    2: () => answer("right"),
    " ": () => views.replay(),
    Backspace: goBack,
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
    if (byId("asking").hidden || byId("enlarged").open || !Object.hasOwn(actions, event.key)) return;
    if (event.key === " " && event.target.matches("button")) return; // presses it
    event.preventDefault();
    actions[event.key]();
  });
}

function setUp() {
  const pairs = sheet.plan.trials.length;
  const anyVideo = STUDY.comparisons.some(({ a }) => isVideo(a));
  byId("pair-count").textContent =
    `${pairs} pair${pairs === 1 ? "" : "s"} of ${anyVideo ? "videos" : "pictures"}`;
  document.body.classList.toggle("pictures", !anyVideo);
  byId("again").hidden = STUDY.repeats === 0;
  sides.forEach((side) => side.addEventListener("click", () => answer(side.dataset.side)));
  byId("begin").addEventListener("click", show);
  byId("back").addEventListener("click", goBack);
  byId("back-again").addEventListener("click", goBack);
  byId("replay").addEventListener("click", () => views.replay());
  byId("source").addEventListener("click", () => {
    byId("enlarged").querySelector("img").src = sheet.trial.comparison.source;
    byId("enlarged").showModal();
  });
  byId("enlarged").addEventListener("click", () => byId("enlarged").close());
  byId("name").addEventListener("input", () => sheet.rename(byId("name").value));
  byId("agreed").addEventListener("change", allow);
  byId("download").addEventListener("click", download);
  byId("copy").addEventListener("click", copy);
  byId("send").addEventListener("click", send);
  byId("next-reader").addEventListener("click", () => {
    sheet.beginAnew();
    saved = false;
    showScreen("welcome");
  });
  setUpKeys();
  if (sheet.position > 0) show();
  else showScreen("welcome");
}

setUp();
