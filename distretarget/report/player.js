// The player: the stage with its buttons and keys.

import {$, button, element, embedded, themed} from './dom.js';
import {buildTimeline} from './timeline.js';
import {buildTransport, clock, followLink, goTo, jump, markLoop, onFrame, repaint, setClip, setPlaying,
  watchers} from './playback.js';
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
const KEYS = [ // what the list of keys calls them, what each does, and what the list says of them
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

/** Frames the views anew, and writes the names of the sides above them. */
function relabel(stage) {
  const tone = actor => element('i', {class: `tone ${actor.tone}`});
  const names = ({title, actors}) => (actors.length === 1 ? [element('span', {}, tone(actors[0]), title)] : [
    element('span', {}, title), ...actors.map(actor => element('span', {class: 'one'}, tone(actor), actor.name))]);
  stage.framed = '';
  $('labels').replaceChildren(...stage.views.map(sides => element('div', {}, ...sides.flatMap(names))));
  repaint();
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

/** Copies the view to a picture for the printer, which cannot see what WebGL has drawn. */
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

/** Saves a film of the loop, or of the whole clip, in the view as it is; a press on the button ends it. */
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
const untouched = $('stage-box').cloneNode(true);

/** Shows data in the player that is there if its bodies are in it, else in a new one; `app` in the console of the
 * browser drives it.
 */
export async function buildPlayer(data = embedded('stage')) {
  if (await globalThis.app?.stage.take(data)) {
    showData(data, await buildRows(data));
    setPlaying(clock.playing);
    return;
  }
  if (globalThis.app) {
    app.stage.renderer.dispose();
    app.stage.renderer.forceContextLoss();
    history.replaceState(null, '', '#');
    delete globalThis.app;
  }
  $('stage-box').replaceWith(untouched.cloneNode(true));
  themed.length = 0;
  const canvas = $('player');
  buildTransport();
  buildKeys();
  const bodies = Stage.of(canvas, data, repaint).catch(() => null);
  const [stage, rows] = await Promise.all([bodies, buildRows(data)]);
  followLink();
  if (!stage) {
    $('labels').replaceChildren(element('div', {}, 'No bodies are shown: this browser draws no WebGL.'));
    return;
  }
  const marks = new Marks(stage);
  globalThis.app = {stage, clock, marks, goTo, setPlaying};
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
  relabel(stage);
  new ResizeObserver(repaint).observe(canvas);
  showData(data, rows);
}

/** Builds what goes with the motions of some data, and returns the rows of its timeline. */
async function buildRows({frames, frame_time: time, jumps, rows}) {
  watchers.length = 0;
  setClip(frames, time, jumps);
  return buildTimeline(rows);
}

/** Shows the motions and the rows of some data. */
function showData(data, rows) {
  const {stage, marks} = app, {canvas} = stage;
  marks.rows = rows;
  $('marks').hidden = !rows.length;
  onFrame(frame => {
    marks.update(frame, data.frame_time);
    stage.draw(frame, clock.playing);
    const touching = rows.filter(row => row.kind === 'contact' && row.codes[frame]).map(row => row.name);
    canvas.setAttribute('aria-label', `${stage.sides.map(({title}) => title).join(', ')} at frame ${frame}`
      + `${touching.length ? `; touching: ${touching.join(', ')}` : ''}`);
  });
}
