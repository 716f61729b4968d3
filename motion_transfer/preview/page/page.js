// The page of `mt preview`: its parts, put together.

import { say } from "./dom.js";
import { setUpCrop } from "./crop.js";
import { setUpKeys } from "./keys.js";
import { Looking } from "./looking.js";
import { setUpNotes, showLost } from "./notes.js";
import { setUpOptions } from "./options.js";
import { setUpOutput } from "./output.js";
import { setUpPlayer } from "./player.js";
import { follow } from "./server.js";
import { setUpScene } from "./scene.js";
import { setUpSources } from "./sources.js";
import { Stage } from "./stage.js";
import { setUpTimeline } from "./timeline.js";
import { setUpViews } from "./views.js";
import { setUpWipe } from "./wipe.js";

const looking = new Looking();
const stage = new Stage(looking);
const choose = setUpOptions(looking);
setUpSources(looking);
setUpScene(looking, choose);
setUpViews(looking);
setUpTimeline(looking, stage);
setUpPlayer(looking);
setUpWipe(looking);
setUpCrop(looking, choose);
setUpNotes(looking);
setUpOutput(looking);
setUpKeys(looking, choose);

let said = null; // the last error that was read out
follow(
  (state) => {
    showLost(null);
    looking.receive(state);
    if (state.error && state.error !== said) say(state.error);
    said = state.error;
  },
  () => {
    looking.reconnecting = true;
    showLost("The server does not answer. Is mt preview still running? Trying again…");
  },
);
looking.look({});
