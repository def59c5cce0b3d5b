// The metrics of each frame as curves over time.

import {$, clamp, colourOf, element, onTheme, shown, term} from './dom.js';
import {clock, dragFrames, onFrame} from './playback.js';
import {nameOf} from './registry.js';
import {unpacked} from './motion.js';

const FLAT_CURVE = 1e-9; // values below this are rounding errors, and are shown as 0

/** Draws one curve, x over all frames, the largest of those in half a pixel; a value between gaps becomes a dot. */
function drawCurve(context, width, height, values, top, dotted) {
  const y = value => height - 2 - Math.min(value / top, 1) * (height - 8);
  const x = frame => 1 + (clock.count > 1 ? frame / (clock.count - 1) : 0.5) * (width - 2);
  context.setLineDash(dotted ? [1, 3] : []);
  context.beginPath();
  let inside = false;
  const step = Math.max(Math.floor(values.length / (2 * width)), 1);
  for (let frame = 0; frame < values.length; frame += step) {
    const value = Math.max(...values.subarray(frame, frame + step));
    if (Number.isNaN(value)) inside = false;
    else {
      if (!inside) context.moveTo(x(frame) - 0.4, y(value));
      context.lineTo(x(frame) + 0.4, y(value));
      inside = true;
    }
  }
  context.stroke();
}

/** Where an axis ends: at the largest value, or lower if a few values far above all others would flatten the curve. */
function axisTop(values, most, least) {
  const usual = [...values].sort((p, q) => p - q)[Math.floor(0.98 * (values.length - 1))];
  return usual > least && most > 5 * usual ? 1.5 * usual : most;
}

/** Shows the curve of a metric; `columns` are its packed values in the frames, of A and of B. */
export async function showCurve(metric, columns) {
  const {key, factor, judged, missing} = metric, least = metric.least * factor;
  const lines = await Promise.all([...judged === 'value' ? [] : [[`${key}_source`, 'a']], [key, 'b']].map(
    async ([field, name]) => ({name, values: (await unpacked(columns[field], Float32Array)).map(x => x * factor)})));
  const known = lines.flatMap(({values}) => [...values]).filter(value => !Number.isNaN(value));
  const most = known.reduce((p, q) => Math.max(p, q), least), top = axisTop(known, most, least);
  const end = top < most ? `${shown(top)}+` : shown(top);
  const canvas = element('canvas', {role: 'img', 'aria-label': `${nameOf(metric)} over time, axis to ${end}`});
  const readout = element('output', {class: 'readout'}), line = element('i', {class: 'line'});
  const draw = () => {
    const {clientWidth: width, clientHeight: height} = canvas, context = canvas.getContext('2d');
    Object.assign(canvas, {width: width * devicePixelRatio, height: height * devicePixelRatio});
    context.scale(devicePixelRatio, devicePixelRatio);
    context.fillStyle = colourOf('line');
    context.fillRect(0, height - 1, width, 1);
    Object.assign(context, {lineJoin: 'round', lineCap: 'round'});
    for (const {values, name} of lines) {
      Object.assign(context, {strokeStyle: colourOf(name), lineWidth: name === 'a' ? 1.25 : 1.6});
      drawCurve(context, width, height, values, top, name === 'a');
    }
  };
  const none = known.length ? '' : element('span', {class: 'none'}, missing || 'nothing to measure');
  $('curves').append(element('figure', {class: 'curve'},
    element('figcaption', {}, term(nameOf(metric), metric.explanation), readout),
    element('div', {class: 'plot'}, canvas, line, none),
    element('div', {class: 'axis', 'aria-hidden': 'true'},
      ...(known.length ? [end, '0'] : []).map(text => element('span', {}, text)))));
  dragFrames(canvas);
  new ResizeObserver(draw).observe(canvas);
  onTheme(draw);
  onFrame(frame => {
    line.style.left = `${clamp(frame / Math.max(clock.count - 1, 1), 0, 1) * 100}%`;
    readout.replaceChildren(...lines.flatMap(({values, name}) => [
      lines.length > 1 ? element('small', {class: `of-${name}`}, name.toUpperCase()) : '',
      element('b', {}, shown(values[frame] < FLAT_CURVE ? 0 : values[frame]))]));
  });
}
