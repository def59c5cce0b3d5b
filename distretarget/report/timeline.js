// The timeline: a row for each contact and each support, coloured by how far it is off.

import {$, colourOf, element, onTheme, shown} from './dom.js';
import {clock, dragFrames, goTo, onFrame} from './playback.js';
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
  Object.assign(canvas, {width, height: 1});
  for (let x = 0; x < width; x++) {
    const first = Math.floor(x * clock.count / width), next = Math.floor((x + 1) * clock.count / width);
    const end = Math.max(next, first + 1);
    let worst = first;
    for (let frame = first; frame < end; frame++) if (row.codes[frame] > row.codes[worst]) worst = frame;
    if (!row.codes[worst]) continue;
    context.fillStyle = colourOf(levelAt(row, worst));
    context.fillRect(x, 0, 1, 1);
  }
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
    const name = {type: 'button', class: 'name', title: `${row.name}: ${row.account}; go to the worst frame`,
      on: {click: () => goTo(worst)}};
    dragFrames(canvas);
    $('timeline').append(element('button', name, row.name), element('div', {class: 'track'}, canvas), value);
    return {row, canvas, value};
  });
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
