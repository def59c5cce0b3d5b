// The player in a frame of the studio's page, which sends it motions and gets the frame and clicks.

import {$, followTheme} from './dom.js';
import {goTo, onFrame, repaint} from './playback.js';
import {showMotions, showTimeline} from './player.js';

const STILL = 4; // a pointer that moves less clicks [pixels]
const tell = message => window.parent.postMessage(message, '*');
let queue = Promise.resolve(), latest = 0, from = [], known = new Map(); // actors and bodies, by their hashes

/** Takes a message from the page; motions that newer ones replace already are left out. */
async function take({motions, timeline, frame, pairs, close, dots}, number) {
  if (motions && number === latest) await showMotions(motions);
  if (timeline && number === latest) await showTimeline(timeline);
  if (Number.isInteger(frame)) goTo(frame);
  if (!globalThis.app) return;
  for (const [name, value] of Object.entries({pairs, dots})) {
    if (!value || String(app.marks[name]) === String(value)) continue;
    app.marks[name] = value;
    repaint();
  }
  if (close) app.stage.approach(frame, pairs.map(([, joint]) => joint));
}

/** Replaces hashes by the actors and bodies that are known already. */
function complete(motions) {
  for (const key of ['actors', 'bodies']) motions[key] = motions[key].map(one => known.get(one) ?? one);
  known = new Map([...motions.actors, ...motions.bodies].map(one => [one.hash, one]));
}

addEventListener('message', ({source, data}) => {
  if (source !== window.parent) return;
  if (data.motions) complete(data.motions);
  const number = data.motions ? ++latest : latest;
  queue = queue.then(() => take(data, number)).catch(reportError); // one after the other, so that none is lost
});
onFrame(frame => tell({frame}));
addEventListener('pointerdown', ({clientX, clientY}) => { from = [clientX, clientY]; }, true);
addEventListener('click', ({target, offsetX, offsetY, clientX, clientY}) => {
  if (target !== $('player') || !globalThis.app || Math.hypot(clientX - from[0], clientY - from[1]) > STILL) return;
  tell(app.stage.jointAt(offsetX, offsetY));
});
followTheme();
tell({ready: true});
