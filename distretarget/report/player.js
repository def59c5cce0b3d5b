// The player: the stage with its buttons and keys.

import {$, button, element, embedded} from './dom.js';
import {buildTimeline, showRows} from './timeline.js';
import {buildTransport, clock, followLink, goTo, jump, markLoop, onFrame, repaint, setClip, setJumps,
  setPlaying} from './playback.js';
import {filmOf} from './film.js';
import {Marks} from './marks.js';
import {MOST_VIEWS, Stage} from './stage.js';

const press = id => () => $(id).click();
const step = sign => event => goTo(clock.frame + sign * (event.shiftKey ? 10 : 1));
const steer = (x, y) => ({shiftKey}, {controls}) => {
  if (shiftKey) controls.pan(40 * x, 40 * y);
  else {
    controls.rotateLeft(0.12 * x);
    controls.rotateUp(-0.12 * y);
  }
};
const zoom = factor => (_, {controls}) => controls.dollyIn(factor);
const KEYS = [ // names for the list of keys, their actions, and the text in the list
  ['Space', {' ': () => setPlaying(!clock.playing)}, 'play or stop'],
  ['← →', {ArrowLeft: step(-1), ArrowRight: step(1)}, 'a frame back or on; with Shift ten'],
  ['Home End', {Home: () => goTo(0), End: () => goTo(clock.count - 1)}, 'first or last frame'],
  ['B N', {b: () => jump(-1), n: () => jump(1)}, 'back or on to a worst frame, contact or cut'],
  ['L', {l: markLoop}, 'begin, end and leave a loop'],
  ['A D W S', {a: steer(-1, 0), d: steer(1, 0), w: steer(0, 1), s: steer(0, -1)}, 'turn the view; with Shift move it'],
  ['+ −', {'+': zoom(1 / 1.2), '-': zoom(1.2)}, 'zoom'],
  ['O', {o: press('overlaid')}, 'lay bodies over each other'],
  ['F', {f: press('follow')}, 'follow the body'],
  ['T', {t: press('trails')}, 'paths of hands and feet'],
  ['C', {c: press('copy')}, 'copy the contact below the timeline, for a contact file'],
  ['M', {m: press('marks')}, 'marks of contacts and supports'],
  ['R', {r: press('reset')}, 'reset the view'],
  ['P', {p: press('picture')}, 'save a picture'],
  ['X', {x: press('full')}, 'full screen'],
  ['?', {'?': press('help')}, 'these keys'],
];
const ACTIONS = Object.assign({}, ...KEYS.map(([, keys]) => keys));

function onKey(event) {
  const {stage} = globalThis.app || {};
  const {tagName: tag, type} = event.target, typing = tag === 'SELECT' || tag === 'INPUT' && type !== 'range';
  const presses = event.key === ' ' && ['BUTTON', 'SUMMARY'].includes(tag);
  const act = ACTIONS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!stage || !act || typing || presses || event.ctrlKey || event.metaKey || event.altKey || $('keys').open) return;
  event.preventDefault();
  act(event, stage);
  repaint();
}

/** Makes a button switch something on and off. */
function toggle(id, owner, name, then = repaint) {
  element($(id), {'aria-pressed': owner[name], on: {click: () => {
    owner[name] = !owner[name];
    $(id).setAttribute('aria-pressed', owner[name]);
    then();
  }}});
}

/** Writes the names of the sides above their views. */
function label(stage) {
  const tone = actor => element('i', {class: `tone ${actor.tone}`});
  const names = ({title, actors}) => (actors.length === 1 ? [element('span', {}, tone(actors[0]), title)] : [
    element('span', {}, title), ...actors.map(actor => element('span', {class: 'one'}, tone(actor), actor.name))]);
  $('labels').replaceChildren(...stage.views.map(sides => element('div', {}, ...sides.flatMap(names))));
  repaint();
}

/** Labels and frames the views again after other sides are shown. */
function relabel(stage) {
  stage.framed = '';
  label(stage);
}

/** Buttons that show and hide the sides, of which one stays, or a list to choose one of many. */
function buildSides(stage) {
  const {sides} = stage;
  $('sides').hidden = sides.length < 2;
  if (sides.length > MOST_VIEWS) {
    $('sides').append(element('select', {'aria-label': 'File', on: {change: ({target}) => {
      sides.forEach((side, k) => { side.shown = k === target.selectedIndex; });
      $('reset').click();
      relabel(stage);
    }}}, ...sides.map(({title, shown}) => new Option(title, title, shown, shown))));
    return;
  }
  $('sides').append(...sides.map(side => button(side.title, ({target}) => {
    if (side.shown && stage.views.flat().length === 1) return;
    side.shown = !side.shown;
    target.setAttribute('aria-pressed', side.shown);
    relabel(stage);
  }, {'aria-pressed': side.shown})));
}

const look = (id, stage, ...angles) => $(id).addEventListener('click', () => stage.look(...angles));

/** Copies the view to a 2D canvas for the printer, which does not print WebGL. */
function copyView() {
  const {stage} = globalThis.app || {};
  if (!stage) return;
  stage.draw(clock.frame);
  const {width, height} = stage.canvas;
  Object.assign($('still'), {width, height}).getContext('2d').drawImage(stage.canvas, 0, 0);
}

function savePicture(stage) {
  stage.draw(clock.frame);
  element('a', {href: stage.canvas.toDataURL('image/png'), download: `frame_${clock.frame}.png`}).click();
}

/** Saves a film of the loop, or of the whole clip, in the present view; another press on the button ends it. */
async function saveFilm() {
  if (filming) {
    filming = false;
    return;
  }
  const {stage, marks} = app, [first, last] = clock.loop?.length === 2 ? clock.loop : [0, clock.count - 1];
  filming = true;
  setPlaying(false);
  $('film').setAttribute('aria-pressed', true);
  try {
    const film = await filmOf(stage.canvas, last - first + 1, clock.frameTime, k => {
      $('film').textContent = `Film ${first + k} – ${last}`;
      marks.update(first + k, clock.frameTime);
      stage.draw(first + k, true);
      return filming;
    });
    const href = URL.createObjectURL(film);
    element('a', {href, download: `frames_${first}_${last}.webm`}).click();
    setTimeout(() => URL.revokeObjectURL(href), 10_000);
  } catch ({message}) {
    $('film').title = `This browser made no film: ${message}`;
  }
  filming = false;
  $('film').textContent = 'Film';
  $('film').setAttribute('aria-pressed', false);
  repaint();
}

function buildKeys() {
  $('key-list').append(...KEYS.flatMap(([names, , text]) => [
    element('dt', {}, ...names.split(' ').flatMap(key => [element('kbd', {}, key), ' '])), element('dd', {}, text)]));
  $('help').addEventListener('click', () => $('keys').showModal());
  $('close').addEventListener('click', () => $('keys').close());
  $('keys').addEventListener('close', () => $('player').focus());
}

let filming = false;
addEventListener('keydown', onKey);
addEventListener('beforeprint', copyView);

/** Builds the player for sides, still without actors; in the browser's console it is `app`. */
function build(data) {
  buildTransport();
  buildTimeline();
  buildKeys();
  let stage;
  try {
    stage = new Stage($('player'), data, repaint);
  } catch {
    $('labels').replaceChildren(element('div', {}, 'No bodies are shown: this browser draws no WebGL.'));
    return null;
  }
  const marks = new Marks(stage);
  buildSides(stage);
  toggle('overlaid', stage, 'overlaid', () => relabel(stage));
  toggle('follow', stage, 'follow');
  toggle('trails', marks, 'trails');
  toggle('marks', marks, 'shown');
  $('overlaid').hidden = stage.sides.length < 2 || stage.sides.length > MOST_VIEWS;
  look('front', stage, 0, 0.05);
  look('side', stage, Math.PI / 2, 0.05);
  look('reset', stage, 0.5, 0.2);
  $('picture').addEventListener('click', () => savePicture(stage));
  element($('film'), {on: {click: saveFilm}}).hidden = !globalThis.VideoEncoder;
  $('full').addEventListener('click', () => (
    document.fullscreenElement ? document.exitFullscreen() : $('stage-box').requestFullscreen()));
  new ResizeObserver(repaint).observe(stage.canvas);
  return {stage, clock, marks, goTo, setPlaying};
}

/** Draws a frame, and describes it for screen readers. */
function drawFrame(frame) {
  const {stage, marks} = app;
  marks.update(frame, clock.frameTime);
  stage.draw(frame, clock.playing);
  const touching = marks.rows.filter(row => row.kind === 'contact' && row.codes[frame]).map(row => row.name);
  stage.canvas.setAttribute('aria-label', `${stage.sides.map(({title}) => title).join(', ')} at frame ${frame}`
    + `${touching.length ? `; touching: ${touching.join(', ')}` : ''}`);
}

/** Waits until an element has a size. */
const laidOut = place => new Promise(go => {
  new ResizeObserver(([{contentRect}], observer) => {
    if (!contentRect.width) return;
    observer.disconnect();
    go();
  }).observe(place);
});

let built;

/** Shows motions in place of those before, at the same time and in the same view; all data has the same sides. */
export async function showMotions(data) {
  if (!$('player').clientWidth) await laidOut($('player'));
  built ??= {app: build(data)};
  const isNew = await built.app?.stage.take(data);
  setClip(data.frames, data.frame_time);
  if (isNew) {
    built.app.marks.build();
    label(built.app.stage);
  }
  if (!built.app || globalThis.app) return;
  globalThis.app = built.app;
  onFrame(drawFrame);
}

/** Shows rows of the timeline, and frames to go to, in place of those before. */
export async function showTimeline({rows, jumps}) {
  setJumps(jumps);
  const shown = await showRows(rows);
  if (!built.app) return;
  built.app.marks.rows = shown;
  $('marks').hidden = !shown.length;
}

/** Shows all of the data of a page, at the frame of its link. */
export async function buildPlayer(data = embedded('stage')) {
  await showMotions(data);
  await showTimeline(data);
  followLink();
}
