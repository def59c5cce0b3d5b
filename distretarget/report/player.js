// The player: the stage with its buttons and keys.

import {$, button, element, embedded, themed} from './dom.js';
import {buildTimeline} from './timeline.js';
import {buildTransport, clock, goTo, jump, markLoop, onFrame, repaint, setPlaying,
  watchers} from './playback.js';
import {Marks} from './marks.js';
import {MOST_VIEWS, Stage} from './stage.js';

const KEYS = [
  ['Space', ' ', 'play or stop', () => setPlaying(!clock.playing)],
  ['← →', 'ArrowLeft', 'a frame back or on; with Shift ten', event => goTo(clock.frame - (event.shiftKey ? 10 : 1))],
  ['', 'ArrowRight', '', event => goTo(clock.frame + (event.shiftKey ? 10 : 1))],
  ['Home End', 'Home', 'first or last frame', () => goTo(0)],
  ['', 'End', '', () => goTo(clock.count - 1)],
  ['B N', 'b', 'back or on to a worst frame, contact or cut', () => jump(-1)],
  ['', 'n', '', () => jump(1)],
  ['L', 'l', 'begin, end and leave a loop', markLoop],
  ['A D W S', 'a', 'turn the view; with Shift move it', (event, stage) => steer(event, stage, -1, 0)],
  ['', 'd', '', (event, stage) => steer(event, stage, 1, 0)],
  ['', 'w', '', (event, stage) => steer(event, stage, 0, 1)],
  ['', 's', '', (event, stage) => steer(event, stage, 0, -1)],
  ['+ −', '+', 'zoom', (_, stage) => stage.zoom(1.2)],
  ['', '-', '', (_, stage) => stage.zoom(1 / 1.2)],
  ['O', 'o', 'lay bodies over each other', () => $('overlaid').click()],
  ['F', 'f', 'follow the body', () => $('follow').click()],
  ['T', 't', 'paths of hands and feet', () => $('trails').click()],
  ['C', 'c', 'copy the contact below the timeline, for a contact file', () => $('copy').click()],
  ['M', 'm', 'marks of contacts and supports', () => $('marks').click()],
  ['R', 'r', 'reset the view', () => $('reset').click()],
  ['P', 'p', 'save a picture', () => $('picture').click()],
  ['X', 'x', 'full screen', () => $('full').click()],
  ['?', '?', 'these keys', () => $('help').click()],
];

function steer(event, stage, x, y) {
  if (event.shiftKey) stage.pan(40 * x, 40 * y);
  else stage.orbit(0.12 * x, -0.12 * y);
}

function onKey(event) {
  const {stage} = globalThis.app || {};
  const {tagName: tag, type} = event.target, typing = tag === 'SELECT' || tag === 'INPUT' && type !== 'range';
  const presses = event.key === ' ' && ['BUTTON', 'SUMMARY'].includes(tag);
  const found = KEYS.find(([, key]) => key === (event.key.length === 1 ? event.key.toLowerCase() : event.key));
  if (!stage || !found || typing || presses || event.ctrlKey || event.metaKey || event.altKey || $('keys').open) return;
  event.preventDefault();
  found[3](event, stage);
  repaint();
}

/** Makes a button switch something on and off. */
function toggle(id, owner, name) {
  $(id).setAttribute('aria-pressed', owner[name]);
  $(id).addEventListener('click', () => {
    owner[name] = !owner[name];
    $(id).setAttribute('aria-pressed', owner[name]);
    if (name === 'overlaid') owner.framed = '';
    label(owner.stage || owner);
    repaint();
  });
}

/** Writes the names of the sides above their views. */
function label(stage) {
  const tone = actor => element('i', {class: `tone ${actor.tone}`});
  const alone = side => element('span', {}, tone(side.actors[0]), side.title);
  const several = side => [element('span', {}, side.title),
    ...side.actors.map(actor => element('span', {class: 'one'}, tone(actor), actor.name))];
  $('labels').replaceChildren(...stage.views.map(sides => element('div', {}, ...sides.flatMap(
    side => (side.actors.length > 1 ? several(side) : [alone(side)])))));
}

/** Buttons that show and hide the sides, of which one stays, or a list to choose one of many. */
function buildSides(stage) {
  $('sides').hidden = stage.sides.length < 2;
  if (stage.sides.length > MOST_VIEWS) {
    $('sides').append(element('select', {'aria-label': 'File', on: {change: event => {
      stage.sides.forEach((side, k) => { side.shown = k === event.target.selectedIndex; });
      $('reset').click();
      label(stage);
      repaint();
    }}}, ...stage.sides.map(({title, shown}) => new Option(title, title, shown, shown))));
    return;
  }
  for (const side of stage.sides) {
    const made = button(side.title, () => {
      if (side.shown && stage.views.flat().length === 1) return;
      side.shown = !side.shown;
      stage.framed = '';
      made.setAttribute('aria-pressed', side.shown);
      label(stage);
      repaint();
    }, {'aria-pressed': side.shown});
    $('sides').append(made);
  }
}

function look(id, stage, azimuth, elevation) {
  $(id).addEventListener('click', () => {
    stage.look(azimuth, elevation);
    repaint();
  });
}

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
  const link = element('a', {href: stage.canvas.toDataURL('image/png'), download: `frame_${clock.frame}.png`});
  link.click();
}

function buildKeys() {
  $('key-list').append(...KEYS.filter(([name]) => name).flatMap(([name, , text]) => [
    element('dt', {}, ...name.split(' ').flatMap(key => [element('kbd', {}, key), ' '])), element('dd', {}, text)]));
  $('help').addEventListener('click', () => $('keys').showModal());
  $('close').addEventListener('click', () => $('keys').close());
  $('keys').addEventListener('close', () => $('player').focus());
}

addEventListener('keydown', onKey);
addEventListener('beforeprint', copyView);
const untouched = $('stage-box').cloneNode(true);

/** Builds the player from its data, instead of one before; `app` in the console of the browser drives it. */
export async function buildPlayer(data = embedded('stage')) {
  if (globalThis.app) {
    app.stage.renderer.dispose();
    app.stage.renderer.forceContextLoss();
    history.replaceState(null, '', '#');
    delete globalThis.app;
  }
  $('stage-box').replaceWith(untouched.cloneNode(true));
  watchers.length = themed.length = 0;
  const canvas = $('player');
  buildTransport(data.frames, data.frame_time, data.jumps);
  buildKeys();
  const bodies = Stage.of(canvas, data, repaint).catch(() => null);
  const [stage, rows] = await Promise.all([bodies, buildTimeline(data.rows)]);
  if (!stage) {
    $('labels').replaceChildren(element('div', {}, 'No bodies are shown: this browser draws no WebGL.'));
    return;
  }
  const marks = new Marks(stage, rows);
  buildSides(stage);
  toggle('overlaid', stage, 'overlaid');
  toggle('follow', stage, 'follow');
  toggle('trails', marks, 'trails');
  toggle('marks', marks, 'shown');
  $('overlaid').hidden = stage.sides.length < 2 || stage.sides.length > MOST_VIEWS;
  $('marks').hidden = !rows.length;
  look('front', stage, data.facing, 0.05);
  look('side', stage, data.facing + Math.PI / 2, 0.05);
  look('reset', stage, data.facing + 0.5, 0.2);
  $('picture').addEventListener('click', () => savePicture(stage));
  $('full').addEventListener('click', () => (
    document.fullscreenElement ? document.exitFullscreen() : $('stage-box').requestFullscreen()));
  label(stage);
  new ResizeObserver(repaint).observe(canvas);
  onFrame(frame => {
    marks.update(frame, data.frame_time);
    stage.draw(frame, clock.playing);
    const touching = rows.filter(row => row.kind === 'contact' && row.codes[frame]).map(row => row.name);
    canvas.setAttribute('aria-label', `${stage.sides.map(({title}) => title).join(', ')} at frame ${frame}`
      + `${touching.length ? `; touching: ${touching.join(', ')}` : ''}`);
  });
  globalThis.app = {stage, clock, marks, goTo, setPlaying};
}
