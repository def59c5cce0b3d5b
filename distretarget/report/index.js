// The page over all clips: head, metrics over the clips, failures, and the table with its filters.

import {$, counted, element, embedded, followTheme, showFacts, shown, term, terms} from './dom.js';
import {metricsAt, nameOf} from './registry.js';

const batch = embedded('batch');
const clips = batch.rows.map(values => Object.fromEntries(values.map((value, k) => [batch.fields[k], value])));
const done = clips.filter(clip => clip.done), failures = clips.filter(clip => !clip.done);
const PAGE = 500; // rows of the table that are added at a time
const FAILURES = 20; // most failures that are listed above the table
const LONG = 240; // characters of a reason from which only its beginning shows until it is opened

const MEDIANS = 'Large numbers are medians over the converted clips, and so are the numbers beside “rotation copy” and '
  + '“source”.';
const COPY = 'rotation copy';
const SHOWN = metricsAt('page over clips').map(columnOf);
const COLUMNS = [
  {name: 'Clip', of: clip => clip.clip, text: true},
  ...batch.targets.length > 1 ? [{name: 'Target', of: targetOf, text: true, cell: clip => [targetOf(clip)]}] : [],
  {name: 'Status', of: clip => statusOf(clip), text: true, cell: statusCell},
  {name: 'Frames', of: clip => clip.frames, cell: clip => [clip.frames?.toLocaleString('en') ?? '–']},
  {name: 'Seconds', of: clip => clip.seconds, cell: clip => [clip.seconds?.toFixed(clip.seconds < 10 ? 2 : 0) ?? '–']},
  ...SHOWN,
  {name: 'Warnings', of: clip => clip.warnings.length, cell: warningsCell},
];
const STATUSES = [
  ['all', 'All clips', () => true],
  ['converted', 'Converted', clip => clip.done],
  ['failed', 'Failed', clip => !clip.done],
  ['warned', 'Need a look', clip => clip.warnings.length],
];

/** The state of the table: the column it is ordered by, downwards or not, the clips that pass, and the rows shown. */
const view = {column: SHOWN[0], down: true, passing: [], rows: 0};

/**
 * The column of a metric: its name, its explanation, `of` for its value of a clip, and `beside`, which has names and
 * functions for the values to compare it with; the table shows the first of these.
 */
function columnOf({key, label, symbol, explanation, judged, factor}) {
  const scaled = suffix => clip => (clip[key + suffix] === null ? null : factor * clip[key + suffix]);
  const column = {
    name: nameOf({label, symbol}),
    explanation,
    of: scaled(''),
    beside: [...judged === 'ratio' ? [['source', scaled('_source')]] : [], [COPY, scaled('_copy')]],
  };
  return {...column, cell: clip => metricCell(column, clip)};
}

function targetOf(clip) {
  return batch.targets[clip.target];
}

function statusOf(clip) {
  return clip.done ? 'converted' : 'failed';
}

function total(values) {
  return values.reduce((sum, value) => sum + value, 0);
}

/** A duration [s] in words. */
function duration(seconds) {
  const minutes = Math.round(seconds / 60);
  if (seconds < 120) return `${shown(seconds)} s`;
  return minutes < 120 ? `${minutes} min` : `${Math.floor(minutes / 60).toLocaleString('en')} h ${minutes % 60} min`;
}

/** The values that are not null, in ascending order. */
function ordered(values) {
  return Float64Array.from(values.filter(value => value !== null)).sort();
}

/** The quantile of ascending numbers at a share from 0 to 1; null if there are no numbers. */
function quantile(numbers, share) {
  if (!numbers.length) return null;
  const place = share * (numbers.length - 1), low = Math.floor(place), high = Math.ceil(place);
  return numbers[low] + (place - low) * (numbers[high] - numbers[low]);
}

// ---- head

function buildHead() {
  const facts = [
    ['Clips', clips.length.toLocaleString('en')],
    ['Converted', done.length.toLocaleString('en')],
    ['Failed', failures.length.toLocaleString('en')],
    ['Frames', total(done.map(clip => clip.frames)).toLocaleString('en')],
    ['Retargeting', `${duration(total(done.map(clip => clip.seconds)))}, all clips added up`],
    ...batch.targets.length === 1 ? [['Target', batch.targets[0]]] : [],
    ...batch.folder ? [['Folder', batch.folder]] : [],
    ['Made by', `distretarget version ${batch.version}`],
  ];
  showFacts(facts);
  $('terms').append(...terms([...SHOWN.map(({name, explanation}) => [name, explanation]), ['Medians', MEDIANS]]));
}

function buildMetric({name, explanation, of, beside}) {
  const numbers = ordered(done.map(of));
  const rows = [['worst', quantile(numbers, 1)]];
  for (const [other, its] of beside) {
    const others = ordered(done.map(its));
    rows.push([other, quantile(others, 0.5)]);
    if (other === COPY) rows.push(['copy’s worst', quantile(others, 1)]);
  }
  return element('div', {class: 'metric'},
    element('h3', {}, term(name, explanation)),
    element('p', {class: 'big'}, shown(quantile(numbers, 0.5)), element('small', {}, ' median')),
    element('dl', {}, ...terms(rows.map(([what, number]) => [what, shown(number)]))));
}

function buildMetrics() {
  $('metrics').hidden = !done.length;
  $('metrics').append(...SHOWN.map(buildMetric));
}

// ---- failures

/** Why a clip failed; only the beginning of a long reason shows until it is opened. */
function reasonOf({error}) {
  if (error.length <= LONG) return element('p', {class: 'reason'}, error);
  return element('details', {class: 'reason'}, element('summary', {}, element('span', {}, error)));
}

function buildFailures() {
  $('failures').hidden = !failures.length;
  $('failures-title').textContent = `${counted(failures.length, 'clip')} failed`;
  $('failed').append(...failures.slice(0, FAILURES).map(clip => element('li', {},
    element('b', {}, clip.clip, ...batch.targets.length > 1 ? [element('small', {}, ` for ${targetOf(clip)}`)] : []),
    reasonOf(clip))));
  if (failures.length <= FAILURES) return;
  const show = () => {
    Object.assign($('status'), {value: 'failed'});
    refresh();
    $('clips').scrollIntoView();
  };
  const all = `Show all ${failures.length.toLocaleString('en')} in the table`;
  $('failures').append(element('button', {type: 'button', on: {click: show}}, all));
}

// ---- table

/** The name of a clip, which may break into lines after slashes. */
function nameCell(clip) {
  const parts = clip.clip.split(/(?<=[/\\])/).flatMap(part => [part, element('wbr')]);
  return element('th', {scope: 'row'}, ...clip.link === null ? parts : [element('a', {href: clip.link}, ...parts)]);
}

function statusCell(clip) {
  const mark = element('span', {'aria-hidden': 'true'}, clip.done ? '✓ ' : '✗ ');
  return [element('span', {class: clip.done ? 'within' : 'over'}, mark, statusOf(clip))];
}

/** The value of a metric, and beside it the first that it is compared with. */
function metricCell({of, beside}, clip) {
  const other = beside.slice(0, 1).map(([, its]) => element('small', {}, shown(its(clip))));
  return [shown(of(clip)), ...other];
}

/** The number of warnings, on a button that shows them in a row below. */
function warningsCell(clip) {
  if (!clip.warnings.length) return ['–'];
  const texts = clip.warnings.map(k => element('li', {}, batch.warnings[k]));
  const told = element('tr', {class: 'told'}, element('td', {colspan: COLUMNS.length}, element('ul', {}, ...texts)));
  const label = `${counted(texts.length, 'warning')} of ${clip.clip}`;
  const button = element('button', {type: 'button', 'aria-expanded': 'false', 'aria-label': label, on: {click: () => {
    const open = !told.isConnected;
    button.setAttribute('aria-expanded', open);
    if (open) button.closest('tr').after(told);
    else told.remove();
  }}}, texts.length);
  return [button];
}

/** The cells of a clip; of one that failed the reason is in place of the metrics. */
function buildRow(clip) {
  const first = COLUMNS.findIndex(({beside}) => beside);
  const cells = COLUMNS.slice(1).filter(({beside}) => clip.done || !beside).map(({name, text, cell}) => (
    element('td', {'data-name': name, class: text ? 'words' : ''}, ...cell(clip))));
  if (!clip.done) cells.splice(first - 1, 0, element('td', {class: 'words', colspan: SHOWN.length}, reasonOf(clip)));
  return element('tr', {}, nameCell(clip), ...cells);
}

/** Adds the next rows to the table. */
function addRows() {
  const next = view.passing.slice(view.rows, view.rows + PAGE);
  $('rows').append(...next.map(buildRow));
  view.rows += next.length;
  const left = view.passing.length - view.rows;
  $('more').hidden = !left;
  $('more').textContent = `Show ${Math.min(PAGE, left)} more`;
  const first = left ? `first ${view.rows.toLocaleString('en')} of ` : '';
  const all = view.passing.length < clips.length ? `, ${clips.length.toLocaleString('en')} in all` : '';
  $('count').textContent = first + counted(view.passing.length, 'clip') + all;
}

const collator = new Intl.Collator('en', {numeric: true});

/** Clips in the order of the view; those without a value come last in either order. */
function sorted(some) {
  const {column, down} = view, sign = down ? -1 : 1;
  const compare = column.text ? collator.compare : (p, q) => p - q;
  const keyed = some.map(clip => [column.of(clip), clip]);
  const there = keyed.filter(([value]) => value !== null).sort(([p], [q]) => sign * compare(p, q));
  return [...there, ...keyed.filter(([value]) => value === null)].map(([, clip]) => clip);
}

/** Shows the clips that pass the filters, in order, from the first row. */
function refresh() {
  const words = $('filter').value.toLowerCase().split(/\s+/), target = $('target').value;
  const [, , passes] = STATUSES.find(([key]) => key === $('status').value);
  const named = clip => {
    const text = `${clip.clip}\n${targetOf(clip)}\n${clip.error || ''}`.toLowerCase();
    return words.every(word => text.includes(word));
  };
  const chosen = clip => passes(clip) && (!target || clip.target === Number(target));
  view.passing = sorted(clips.filter(clip => chosen(clip) && named(clip)));
  view.rows = 0;
  $('rows').replaceChildren();
  addRows();
  if (!view.rows) $('rows').append(element('tr', {}, element('td', {class: 'words none', colspan: COLUMNS.length},
    clips.length ? 'No clip passes the filters.' : 'There are no clips.')));
}

/** Keeps the head of the table on the screen if its whole width fits, otherwise its first column. */
function fit() {
  const whole = $('rows').offsetWidth <= $('box').clientWidth;
  $('box').classList.toggle('whole', whole);
  $('box').classList.toggle('part', !whole);
}

function markHeads() {
  COLUMNS.forEach((column, k) => {
    const head = $('heads').children[k];
    if (column === view.column) head.setAttribute('aria-sort', view.down ? 'descending' : 'ascending');
    else head.removeAttribute('aria-sort');
  });
}

function sortBy(column) {
  Object.assign(view, {down: column === view.column ? !view.down : !column.text, column});
  markHeads();
  refresh();
}

function buildHeads() {
  for (const column of COLUMNS) {
    const [name, unit] = column.name.split(', ');
    const others = (column.beside || []).slice(0, 1).map(([other]) => other.split(' ').pop());
    const below = [...unit ? [unit] : [], ...others].join(' · ');
    const button = element('button', {type: 'button', on: {click: () => sortBy(column)}},
      element('span', {}, name), ...below ? [element('small', {}, below)] : []);
    if (column.explanation) button.title = column.explanation;
    $('heads').append(element('th', {scope: 'col', class: column.text ? 'words' : 'number'}, button));
  }
  markHeads();
}

function buildFilters() {
  const option = (value, text, some) => element('option', {value}, `${text} (${some.length.toLocaleString('en')})`);
  $('status').append(...STATUSES.map(([key, text, passes]) => option(key, text, clips.filter(passes))));
  $('target').append(element('option', {value: ''}, 'All targets'), ...batch.targets.map(
    (name, k) => option(k, name, clips.filter(clip => clip.target === k))));
  $('target').hidden = batch.targets.length < 2;
  for (const id of ['filter', 'status', 'target']) $(id).addEventListener('input', refresh);
  $('more').addEventListener('click', addRows);
}

// ---- all of it

function start() {
  buildHead();
  buildMetrics();
  buildFailures();
  buildFilters();
  buildHeads();
  refresh();
  followTheme();
  [$('box'), $('rows')].forEach(place => new ResizeObserver(fit).observe(place));
}

start();
