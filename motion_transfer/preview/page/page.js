// The page of `mt preview`: its parts, put together.

import { say } from "./dom.js";
import { setUpCrop } from "./crop.js";
import { setUpDrops } from "./drops.js";
import { setUpGarments } from "./garments.js";
import { setUpKeys } from "./keys.js";
import { Looking } from "./looking.js";
import { setUpMotions } from "./motions.js";
import { setUpNotes, showLost } from "./notes.js";
import { setUpOptions } from "./options.js";
import { setUpOutput } from "./output.js";
import { setUpPlayer } from "./player.js";
import { setUpRenders } from "./renders.js";
import { follow } from "./server.js";
import { setUpScene } from "./scene.js";
import { setUpSources } from "./sources.js";
import { Stage } from "./stage.js";
import { setUpTimeline } from "./timeline.js";
import { setUpViews } from "./views.js";
import { setUpWipe } from "./wipe.js";
import { setUpZoom } from "./zoom.js";

// Where everything stands below everything else, what few need is folded away at first.
if (matchMedia("(max-width: 899px)").matches) {
  for (const part of document.querySelectorAll("details.part")) part.open = false;
}

const looking = new Looking();
const stage = new Stage(looking);
const choose = setUpOptions(looking);
setUpDrops(looking, {
  ...setUpSources(looking),
  motion: setUpMotions(looking),
  garment: setUpGarments(looking),
  background: setUpScene(looking, choose),
});
setUpViews(looking);
setUpTimeline(looking, stage);
setUpPlayer(looking);
setUpWipe(looking);
setUpCrop(looking, choose);
setUpZoom(looking);
setUpNotes(looking);
setUpOutput(looking, choose);
setUpRenders(looking);
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
