// The timeline: a row for each contact and each support, coloured by how far it is off.

import {$, button, colourOf, element, onTheme, shown} from './dom.js';
import {clock, dragFrames, goTo, onFrame, repaint} from './playback.js';
import {unpacked} from './motion.js';

/** How far a row is off at a frame, in its unit. */
export function offAt({codes, top}, frame) {
  return (codes[frame] - 1) / 254 * top;
}

/** The name of the colour of a row at a frame: within its limit, over it, or over twice of it. */
export function levelAt(row, frame) {
  const value = offAt(row, frame), {limit} = row;
  return value <= limit ? 'within' : value <= 2 * limit ? 'warm' : 'over';
}

/** Draws the spans of a row; of frames that share a pixel the worst is drawn. */
function drawRow(canvas, row) {
  const width = Math.round(canvas.clientWidth * devicePixelRatio), context = canvas.getContext('2d');
  if (!width) return;
  Object.assign(canvas, {width, height: 3});
  for (const {frames: [from, last], mark} of row.marked) {
    const left = Math.floor(from * width / clock.count), right = Math.ceil((last + 1) * width / clock.count);
    context.fillStyle = colourOf({found: 'line-strong', dropped: 'violet', added: 'b'}[mark]);
    context.fillRect(left, {found: 0, dropped: 1, added: 2}[mark], right - left, 1);
  }
  for (let x = 0; x < width; x++) {
    const first = Math.floor(x * clock.count / width), next = Math.floor((x + 1) * clock.count / width);
    const end = Math.max(next, first + 1);
    let worst = first;
    for (let frame = first; frame < end; frame++) if (row.codes[frame] > row.codes[worst]) worst = frame;
    if (!row.codes[worst]) continue;
    context.fillStyle = colourOf(levelAt(row, worst));
    context.fillRect(x, 0, 1, row.marked.some(({frames: [from, last], mark}) => (
      mark === 'added' && from < end && first <= last)) ? 2 : 3);
  }
}

/** What a contact file says of the contact of a row that is nearest to a frame; nothing of a row that is none. */
function entryAt({marked}, frame) {
  const away = ({frames: [from, last]}) => Math.max(from - frame, frame - last, 0);
  return marked.length ? marked.reduce((best, one) => (away(one) < away(best) ? one : best)) : null;
}

/** Shows the entry of the row that was pointed at or focused last, with a button that copies it. */
function buildCopying(parts) {
  let chosen = parts.find(({row}) => row.marked.length), copied = '';
  $('copying').hidden = !chosen;
  if (!chosen) return;
  const show = frame => {
    const {json, mark} = entryAt(chosen.row, frame) || {};
    $('entry').textContent = json ? `${json === copied ? 'copied' : mark}: ${json}` : `no entry for ${chosen.row.name}`;
    $('copy').disabled = !json;
    for (const {name, row} of parts) name.classList.toggle('chosen', row === chosen.row);
  };
  for (const part of parts) {
    for (const [one, type] of [[part.name, 'focus'], [part.name, 'pointerenter'], [part.canvas, 'pointerenter']]) {
      one.addEventListener(type, () => {
        chosen = part;
        repaint();
      });
    }
  }
  $('copy').addEventListener('click', async () => {
    const {json} = entryAt(chosen.row, clock.frame);
    await navigator.clipboard?.writeText(json).catch(() => null);
    copied = json;
    repaint();
  });
  onFrame(show);
}

/** Builds the rows of the timeline and returns them with their codes unpacked: 0, or how far off they are. */
export async function buildTimeline(rows) {
  const made = await Promise.all(rows.map(async row => ({...row, codes: await unpacked(row.codes, Uint8Array),
    spots: row.spots && await unpacked(row.spots, Uint16Array)})));
  $('timeline').hidden = !made.length;
  const parts = made.map(row => {
    const canvas = element('canvas', {role: 'img', 'aria-label': `${row.name}: ${row.account}`});
    const value = element('output', {});
    const worst = row.codes.reduce((best, code, frame) => (code > row.codes[best] ? frame : best), 0);
    const title = `${row.name}: ${row.account}; go to the worst frame`;
    const name = button(row.name, () => goTo(worst), {class: 'name', title});
    dragFrames(canvas);
    $('timeline').append(name, element('div', {class: 'track'}, canvas), value);
    return {row, canvas, name, value};
  });
  buildCopying(parts);
  const line = $('timeline').appendChild(element('i', {class: 'line'}));
  const drawAll = () => parts.forEach(({canvas, row}) => drawRow(canvas, row));
  new ResizeObserver(drawAll).observe($('timeline'));
  onTheme(drawAll);
  onFrame(frame => {
    for (const {row, value} of parts) {
      const code = row.codes[frame];
      value.textContent = code && row.unit ? `${shown(offAt(row, frame))} ${row.unit}` : '';
      value.className = code ? levelAt(row, frame) : '';
    }
    if (parts.length) {
      const {offsetLeft, clientWidth} = parts[0].canvas.parentElement;
      line.style.left = `${offsetLeft + (frame + 0.5) / clock.count * clientWidth}px`;
    }
  });
  return made;
}
