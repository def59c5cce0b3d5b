// The metrics of each frame as curves over time.

import {$, element, shown} from './dom.js';
import {clock, dragFrames, onFrame} from './playback.js';
import {named, nameOf, scaled} from './metrics.js';
import {unpacked} from './motion.js';

const HEIGHT = 100; // of a curve in its own units
const POINTS = 2000; // of a curve, at most: of frames that share one the largest value is drawn

const svg = tag => document.createElementNS('http://www.w3.org/2000/svg', tag);

/** The path of a curve, x in frames; a value between gaps becomes a dot. */
function pathOf(values, top) {
  const step = Math.ceil(values.length / POINTS), parts = [];
  let inside = false;
  for (let frame = 0; frame < values.length; frame += step) {
    const value = Math.max(...values.subarray(frame, frame + step)), known = !Number.isNaN(value);
    const y = (HEIGHT * (1 - Math.min(value / top, 1))).toFixed(1);
    if (known) parts.push(`${inside ? 'L' : 'M'}${frame + 0.1} ${y}L${frame + 0.9} ${y}`);
    inside = known;
  }
  return parts.join('');
}

/** Where an axis ends: at the largest value, or lower if a few values far above all others would flatten the curve. */
function axisTop(values, most, least) {
  const usual = values.toSorted()[Math.floor(0.98 * (values.length - 1))];
  return usual > least && most > 5 * usual ? 1.5 * usual : most;
}

/** Shows the curve of a metric; `columns` are its packed values in the frames, of A and of B. */
export async function showCurve(metric, columns) {
  const {key, factor, judged, missing} = metric, least = metric.least * factor;
  const lines = await Promise.all([...judged === 'value' ? [] : [[`${key}_source`, 'a']], [key, 'b']].map(
    async ([field, name]) => ({name, values: (await unpacked(columns[field], Float32Array)).map(x => x * factor)})));
  const known = Float32Array.from(lines.flatMap(({values}) => [...values]).filter(value => !Number.isNaN(value)));
  const most = known.reduce((p, q) => Math.max(p, q), least), top = axisTop(known, most, least);
  const end = top < most ? `${shown(top)}+` : shown(top);
  const box = {viewBox: `0 0 ${clock.count} ${HEIGHT}`, preserveAspectRatio: 'none'};
  const label = {role: 'img', 'aria-label': `${nameOf(metric)} over time, axis to ${end}`};
  const paths = lines.map(({name, values}) => element(svg('path'), {class: `of-${name}`, d: pathOf(values, top)}));
  const picture = element(svg('svg'), {...box, ...label}, ...paths);
  const readout = element('span', {class: 'readout'}), line = element('i', {class: 'line'});
  const none = known.length ? '' : element('span', {class: 'none'}, missing || 'nothing to measure');
  const plot = element('div', {class: 'plot'}, picture, line, none);
  $('curves').append(element('figure', {class: 'curve'}, element('figcaption', {}, named(metric), readout), plot,
    element('div', {class: 'axis', 'aria-hidden': 'true'},
      ...(known.length ? [end, '0'] : []).map(text => element('span', {}, text)))));
  dragFrames(plot);
  onFrame(frame => {
    line.style.left = `${(frame + 0.5) / clock.count * 100}%`;
    readout.replaceChildren(...lines.flatMap(({values, name}) => [
      lines.length > 1 ? element('small', {class: `of-${name}`}, name.toUpperCase()) : '',
      element('b', {}, shown(scaled(values[frame], 1)))]));
  }, plot);
}
