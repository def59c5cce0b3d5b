// The player in the page of the studio, which sends what is to be shown, and hears of the frame and of clicks.

import {$, followTheme} from './dom.js';
import {clock, goTo, onFrame, repaint} from './playback.js';
import {buildPlayer} from './player.js';

const STILL = 4; // a pointer that moves less clicks [pixels]
const tell = message => window.parent.postMessage(message, '*');
let building = Promise.resolve(), asked = 0, from = [];

async function take(data, turn) {
  if (turn !== asked) return; // later data has come
  await buildPlayer(data);
  onFrame(frame => tell({frame}));
  requestAnimationFrame(() => tell({drawn: turn, frame: clock.frame}));
}

addEventListener('message', ({source, data}) => {
  if (source !== window.parent) return;
  if (Number.isInteger(data.frame)) goTo(data.frame);
  if (data.pair && globalThis.app && String(app.marks.pair) !== String(data.pair)) {
    app.marks.pair = data.pair;
    repaint();
  }
  if (!data.stage) return;
  const turn = ++asked;
  building = building.then(() => take(data.stage, turn));
});
addEventListener('pointerdown', ({clientX, clientY}) => { from = [clientX, clientY]; }, true);
addEventListener('click', ({target, offsetX, offsetY, clientX, clientY}) => {
  if (target !== $('player') || Math.hypot(clientX - from[0], clientY - from[1]) > STILL) return;
  tell(app.stage.jointAt(offsetX, offsetY));
});
followTheme();
tell({ready: true});
