// The timeline: a row for each contact and each support, coloured by its error.

import {$, button, element, shown} from './dom.js';
import {clock, dragFrames, goTo, onFrame, repaint} from './playback.js';
import {unpacked} from './motion.js';

const PARTS = 1000; // of a row, at most; each has the colour of its worst frame
const MARKS = {found: ['line-strong', 'top'], dropped: ['violet', 'center'], added: ['b', 'bottom']};

/** The error of a row at a frame, in its unit. */
export const offAt = ({codes, top}, frame) => (codes[frame] - 1) / 254 * top;

/** The name of the colour of a row at a frame: within its limit, over it, or over twice the limit. */
export function levelAt(row, frame) {
  const value = offAt(row, frame), {limit} = row;
  return value <= limit ? 'within' : value <= 2 * limit ? 'warm' : 'over';
}

/** A background of stripes, each [from, to, name of a colour], with places from 0 to 1 in the clip. */
function stripes(parts) {
  const stops = parts.flatMap(([from, to, tone]) => [
    `transparent ${100 * from}%`, `var(--${tone}) ${100 * from}% ${100 * to}%`, `transparent ${100 * to}%`]);
  return `linear-gradient(to right, ${['transparent', ...stops, 'transparent'].join()})`;
}

/** The spans in which a row is active, as `stripes` takes them. */
function levels(row) {
  const step = Math.ceil(clock.count / PARTS), made = [];
  for (let first = 0; first < clock.count; first += step) {
    let worst = first;
    const end = Math.min(first + step, clock.count), from = first / clock.count, last = made.at(-1);
    for (let frame = first; frame < end; frame++) if (row.codes[frame] > row.codes[worst]) worst = frame;
    const tone = row.codes[worst] ? levelAt(row, worst) : '';
    if (last && last[1] === from && last[2] === tone) last[1] = end / clock.count;
    else if (tone) made.push([from, end / clock.count, tone]);
  }
  return made;
}

/** The backgrounds of a row: thin stripes of its found, dropped and added contacts, and below them its levels. */
function backgrounds(row) {
  const thin = Object.entries(MARKS).flatMap(([mark, [tone, place]]) => {
    const own = row.marked.filter(one => one.mark === mark);
    const spans = own.map(({frames: [first, last]}) => [first / clock.count, (last + 1) / clock.count, tone]);
    return own.length ? [`${stripes(spans.sort(([p], [q]) => p - q))} ${place} / 100% 4px no-repeat`] : [];
  });
  return [...thin, `${stripes(levels(row))} var(--soft)`].join();
}

/** The entry, for a contact file, of the contact of a row nearest to a frame; {} for a row without contacts. */
function entryAt({marked}, frame) {
  const away = ({frames: [from, last]}) => Math.max(from - frame, frame - last, 0);
  return marked.toSorted((one, other) => away(one) - away(other))[0] || {};
}

let parts = [], line = null, chosen = null, copied = ''; // rows with their elements, and the line of the frame

/** Shows the entry of the row that was pointed at or focused last. */
function showEntry(frame) {
  const {json, mark} = entryAt(chosen.row, frame);
  $('entry').textContent = json ? `${json === copied ? 'copied' : mark}: ${json}` : `no entry for ${chosen.row.name}`;
  $('copy').disabled = !json;
  for (const {name, row} of parts) name.classList.toggle('chosen', row === chosen.row);
}

/** Makes the timeline follow the frame, and its button copy the entry. */
export function buildTimeline() {
  $('copy').onclick = async () => {
    copied = entryAt(chosen.row, clock.frame).json;
    await navigator.clipboard?.writeText(copied).catch(() => null);
    repaint();
  };
  onFrame(frame => {
    if (chosen) showEntry(frame);
    for (const {row, value} of parts) {
      const code = row.codes[frame], text = code && row.unit ? `${shown(offAt(row, frame))} ${row.unit}` : '';
      if (value.textContent !== text) value.textContent = text;
      value.className = `value ${code ? levelAt(row, frame) : ''}`;
    }
    if (line) line.style.left = `${(frame + 0.5) / clock.count * 100}%`;
  });
}

/** Shows rows in place of those before, and returns them with their codes unpacked. */
export async function showRows(rows) {
  parts = await Promise.all(rows.map(async data => {
    const row = {...data, codes: await unpacked(data.codes, Uint8Array),
      spots: data.spots && await unpacked(data.spots, Uint16Array)};
    const worst = row.codes.indexOf(row.codes.reduce((p, q) => Math.max(p, q))), label = `${row.name}: ${row.account}`;
    const name = button(row.name, () => goTo(worst), {class: 'name', title: `${label}; go to the worst frame`});
    const track = element('div', {class: 'track', role: 'img', 'aria-label': label}), value = element('span');
    track.style.background = backgrounds(row);
    dragFrames(track);
    const part = {row, track, name, value}, choose = () => {
      chosen = part;
      repaint();
    };
    element(name, {on: {focus: choose, pointerenter: choose}});
    element(track, {on: {pointerenter: choose}});
    return part;
  }));
  chosen = parts.find(({row}) => row.marked.length);
  $('copying').hidden = !chosen;
  $('timeline').hidden = !parts.length;
  line = element('i', {class: 'line'});
  const overlay = element('div', {class: 'overlay'}, line);
  $('timeline').replaceChildren(...parts.flatMap(({name, track, value}) => [name, track, value]), overlay);
  repaint();
  return parts.map(({row}) => row);
}
