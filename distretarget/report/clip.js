// The report on a clip: head, cards, curves over time and contacts below the player.

import {$, counted, element, embedded, followTheme, onTheme, showFacts, shown, terms} from './dom.js';
import {cardOf, METRICS, metricsAt, named, nameOf, scaled} from './metrics.js';
import {unpacked} from './motion.js';
import {clock, dragFrames, goTo, onFrame, repaint} from './playback.js';
import {buildPlayer} from './player.js';
import {tableOf} from './tables.js';

const report = embedded('document'), ofRun = report.metrics.rotation_copy !== null;
const D_MEANS = 'Distance of two joints divided by the length of the bones between them: 0 where they coincide, 1 '
  + 'where the path between them is straight.';
const COPY_MEANS = 'The rotation copy: A’s rotations on the bones of B, before anything is corrected.';
const HEIGHT = 100; // of a curve in its own units
const POINTS = 2000; // of a curve, at most; each is the largest value of its frames

function buildHead() {
  const body = ({file, joints, convention}) => `${file}, ${joints} joints${convention ? `, ${convention}` : ''}`;
  const seconds = shown(report.frame_count * report.frame_time);
  const frames = `${counted(report.frame_count, 'frame')} of ${shown(1000 * report.frame_time)} ms, ${seconds} s`;
  const [roleA, roleB] = ofRun ? ['the source', 'the result'] : ['the reference', 'measured'];
  const [nameA, nameB] = ['a', 'b'].map(name => element('span', {class: `of-${name}`}, report[name].file));
  $('title').append(...ofRun ? ['result ', nameB, ' against source ', nameA] : [nameB, ' against ', nameA]);
  $('verdict').hidden = !report.verdict;
  $('verdict').textContent = report.verdict;
  $('looks').hidden = !report.warnings.length;
  $('warnings').append(...report.warnings.map(text => element('li', {}, text)));
  showFacts([[`A, ${roleA}`, body(report.a)], [`B, ${roleB}`, body(report.b)], ['Frames', frames], ['Made by',
    element('span', {}, element('code', {}, report.program.command || 'distretarget'),
      ` version ${report.program.version}`)]]);
  $('terms').append(...terms([...METRICS.map(metric => [nameOf(metric), metric.explanation]), ['D', D_MEANS],
    ['Contact', report.touching], ...ofRun ? [['Copy', COPY_MEANS]] : []]));
}

/** A line with a mark on whether a metric is within a limit; `over` is null if it has no value. */
function limitLine(name, limit, over, factor) {
  const most = `${name} ${String(Number((limit * factor).toPrecision(3)))}`;
  if (over === null) return element('p', {class: 'limit'}, most);
  return element('p', {class: over ? 'limit over' : 'limit within'},
    element('span', {'aria-hidden': 'true'}, over ? '✗ ' : '✓ '), `${over ? 'over' : 'within'} ${most}`);
}

function cardOfClip(metric) {
  const {key, factor, judged, comparison, whole, missing, supersededBy} = metric;
  const inUnits = judged === 'ratio' ? 1 : factor;
  const {source, result, rotation_copy: copy, limits: usual} = report.metrics, value = scaled(result[key], factor);
  const judgeable = value !== null && usual[key] !== null && (result[supersededBy] ?? null) === null;
  const over = judgeable && result[key] > usual[key], limits = report.limits.filter(one => one.metric === key);
  const rows = [
    ...judged === 'value' ? [] : [['A', scaled(source[key], factor)]],
    ...scaled(copy?.[key], 1) === null ? [] : [['copy', scaled(copy[key], factor)]],
    ...comparison && limits.length ? [[comparison, scaled(limits[0].value, inUnits)]] : []];
  const big = value === null ? missing : whole ? String(value) : shown(value);
  return cardOf(metric, element('p', {class: value === null ? 'big none' : 'big'}, big), rows, [
    ...judgeable ? [limitLine('', usual[key], over, factor)] : [],
    ...limits.map(one => limitLine('limit', one.limit, one.value === null ? null : one.over, inUnits))], over);
}

function buildCards() {
  const first = metricsAt('card');
  $('metrics').append(...first.map(cardOfClip));
  $('other-metrics').append(...METRICS.filter(one => !first.includes(one)).map(cardOfClip));
}

function buildNotes() {
  const lines = report.notes.map(note => element('li', {}, `${note[0].toUpperCase()}${note.slice(1)}.`));
  for (const [names, of, other] of [[report.unmatched_b, 'B', 'A'], [report.unmatched_a, 'A', 'B']]) {
    if (!names.length) continue;
    const count = `${counted(names.length, 'joint')} of ${of} without a counterpart in ${other}`;
    lines.push(element('li', {}, names.length <= 6 ? `${count}: ${names.join(', ')}.`
      : element('details', {}, element('summary', {}, count), names.join(', '))));
  }
  $('notes').hidden = !lines.length;
  $('notes').append(element('ul', {}, ...lines));
}

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

/** The end of an axis: the largest value, or less if a few values far above all others would flatten the curve. */
function axisTop(values, most, least) {
  const usual = values.toSorted()[Math.floor(0.98 * (values.length - 1))];
  return usual > least && most > 5 * usual ? 1.5 * usual : most;
}

/** Shows the curve of a metric; `columns` have the packed values of A and of B in the frames, by key. */
async function showCurve(metric, columns) {
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

function buildWorst() {
  const worst = clock.jumps.filter(({kind}) => kind === 'Worst frames');
  globalThis.app?.stage.draw(clock.frame);
  for (const {frame, text} of worst) {
    const picture = element('canvas', {width: 264, height: 208, 'aria-hidden': 'true'});
    $('worst').append(element('button', {type: 'button', on: {click: () => goTo(frame)}}, picture, text));
    if (globalThis.app) onTheme(() => {
      app.marks.update(frame, report.frame_time);
      app.stage.snapshot(frame, picture);
    });
  }
  repaint();
  if (!worst.length) $('worst').append(element('p', {class: 'none'}, 'B moves like A in every frame.'));
}

async function start() {
  buildHead();
  buildNotes();
  buildCards();
  followTheme();
  await buildPlayer();
  const contacts = embedded('contact-table'), none = 'No two regions of the body touch in A.';
  $('contacts').append(contacts.rows.length ? tableOf(contacts) : element('p', {class: 'none'}, none));
  const columns = embedded('columns');
  for (const metric of metricsAt('curve')) await showCurve(metric, columns);
  buildWorst();
}

start();
