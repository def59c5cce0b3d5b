// The time of a player: frames, speed, loop, jumps, and the links to frames.

import {$, clamp, element} from './dom.js';

export const clock = {frame: 0, count: 1, frameTime: 1 / 30, playing: false, speed: 1, loop: null, jumps: []};
const watchers = [];
let seconds = 0, before = 0, waiting = false;

/** Calls `watch` with the frame for each picture, in the order of these calls; during playback only while the element
 * `place` is in view.
 */
export function onFrame(watch, place = null) {
  let seen = true;
  watchers.push(frame => { if (seen || !clock.playing) watch(frame); });
  if (place) new IntersectionObserver(([{isIntersecting}]) => { seen = isIntersecting; }).observe(place);
  repaint();
}

export function repaint() {
  if (!waiting) requestAnimationFrame(tick);
  waiting = true;
}

export function goTo(frame) {
  clock.frame = clamp(Math.round(frame), 0, clock.count - 1);
  seconds = clock.frame * clock.frameTime;
  if (!clock.playing) history.replaceState(null, '', `#frame=${clock.frame}`);
  repaint();
}

export function setPlaying(playing) {
  clock.playing = playing && clock.count > 1;
  before = performance.now();
  $('play').setAttribute('aria-label', clock.playing ? 'Stop' : 'Play');
  $('play').classList.toggle('playing', clock.playing);
  if (!clock.playing) goTo(clock.frame);
  repaint();
}

/** The frame `passed` seconds after the present one, in the loop or the whole clip. */
function advanced(passed) {
  const [first, last] = clock.loop?.length === 2 ? clock.loop : [0, clock.count - 1];
  const span = (last - first + 1) * clock.frameTime, start = first * clock.frameTime;
  seconds += passed * clock.speed;
  if (seconds < start || seconds >= start + span) seconds = start + ((seconds - start) % span + span) % span;
  return clamp(Math.floor(seconds / clock.frameTime + 1e-6), first, last);
}

export function tick(now) {
  waiting = false;
  if (clock.playing) clock.frame = advanced(Math.max(0, now - before) / 1000);
  before = now;
  showFrame();
  watchers.forEach(watch => watch(clock.frame));
  if (clock.playing) repaint();
}

function showFrame() {
  const text = `${(clock.frame * clock.frameTime).toFixed(2)} s`, last = clock.count - 1;
  $('slider').value = clock.frame;
  $('slider').setAttribute('aria-valuetext', `frame ${clock.frame} of ${last}, ${text}`);
  $('now').textContent = `${clock.frame} / ${last} · ${text}`;
}

/** Marks the frame as the start of a loop, then as its end; a third call removes the loop. */
export function markLoop() {
  const {loop, frame} = clock;
  clock.loop = !loop ? [frame] : loop.length === 1 ? [...loop, frame].sort((p, q) => p - q) : null;
  const [first, last] = clock.loop || [];
  $('loop').textContent = !clock.loop ? 'Loop' : last === undefined ? `Loop ${first} –` : `Loop ${first} – ${last}`;
  $('loop').setAttribute('aria-pressed', Boolean(clock.loop));
  repaint();
}

/** Goes to the next jump in a direction, +1 or -1. */
export function jump(direction) {
  const beyond = clock.jumps.map(({frame}) => frame).filter(frame => direction * (frame - clock.frame) > 0);
  if (beyond.length) goTo(direction > 0 ? Math.min(...beyond) : Math.max(...beyond));
}

export function followLink() {
  const [, frame] = /^#frame=(\d+)$/.exec(location.hash) || [];
  if (frame !== undefined) goTo(Number(frame));
}

addEventListener('hashchange', followLink);

/** Takes the frames of a clip, and keeps the time; a loop is removed if the number of frames changes. */
export function setClip(count, frameTime) {
  while (clock.loop && count !== clock.count) markLoop();
  Object.assign(clock, {count, frameTime, frame: clamp(Math.round(seconds / frameTime), 0, count - 1)});
  for (const id of ['slider', 'play', 'loop', 'speed']) $(id).disabled = count < 2;
  $('slider').max = count - 1;
  setPlaying(clock.playing);
}

/** Takes frames to go to, each with a kind and a text. */
export function setJumps(jumps) {
  clock.jumps = jumps;
  $('jump').replaceChildren($('jump').options[0], ...Object.entries(Object.groupBy(jumps, ({kind}) => kind)).map(
    ([label, some]) => element('optgroup', {label}, ...some.map(({frame, text}) => new Option(text, frame)))));
  $('jump').hidden = !jumps.length;
}

/** Connects slider and buttons. */
export function buildTransport() {
  element($('slider'), {on: {input: ({target}) => goTo(Number(target.value))}});
  $('play').addEventListener('click', () => setPlaying(!clock.playing));
  $('back').addEventListener('click', () => goTo(clock.frame - 1));
  $('next').addEventListener('click', () => goTo(clock.frame + 1));
  $('loop').addEventListener('click', markLoop);
  $('speed').addEventListener('change', event => { clock.speed = Number(event.target.value); });
  $('jump').addEventListener('change', event => {
    goTo(Number(event.target.value));
    event.target.selectedIndex = 0;
  });
}

/** Makes pressing or dragging on an element, whose width is the whole clip, go to the frame at that place. */
export function dragFrames(target) {
  const go = ({clientX, buttons}) => {
    const {left, width} = target.getBoundingClientRect();
    if (buttons) goTo((clientX - left) / width * (clock.count - 1));
  };
  target.addEventListener('pointerdown', event => {
    target.setPointerCapture(event.pointerId);
    go(event);
  });
  target.addEventListener('pointermove', go);
}
