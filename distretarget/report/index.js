// The page on all clips: head, metrics over the clips, a player, and the table with its filters.

import {$, button, counted, element, embedded, followTheme, showFacts, shown, terms, total} from './dom.js';
import {cardOf, metricsAt, nameOf} from './metrics.js';
import {goTo} from './playback.js';
import {buildPlayer} from './player.js';

const batch = embedded('batch');
const clips = batch.rows.map(values => Object.fromEntries(values.map((value, k) => [batch.fields[k], value])));
const done = clips.filter(clip => clip.done);
const PAGE = 500; // rows of the table that are added at a time
const LONG = 240; // characters of a reason from which on only its beginning shows until it is opened
const MEDIANS = 'Large numbers are medians over the converted clips, and so are the numbers beside “rotation copy” and '
  + '“source”.';
const COPY = 'rotation copy';
const targetOf = clip => batch.targets[clip.target];
const statusOf = clip => (clip.done ? 'converted' : 'failed');
const SHOWN = metricsAt('page over clips').map(columnOf);
const COLUMNS = [
  {name: 'Clip', of: clip => clip.clip, text: true},
  ...batch.targets.length > 1 ? [{name: 'Target', of: targetOf, text: true, cell: clip => [targetOf(clip)]}] : [],
  {name: 'Status', of: statusOf, text: true, cell: statusCell},
  {name: 'Frames', of: clip => clip.frames, cell: clip => [clip.frames?.toLocaleString('en') ?? '–']},
  {name: 'Seconds', of: clip => clip.seconds, cell: clip => [clip.seconds?.toFixed(clip.seconds < 10 ? 2 : 0) ?? '–']},
  ...SHOWN,
  {name: 'Warnings', of: clip => clip.warnings.length, cell: warningsCell},
];
const STATUSES = [
  ['all', 'All clips', () => true],
  ['converted', 'Converted', clip => clip.done],
  ['failed', 'Failed', clip => !clip.done],
  ['warned', 'With warnings', clip => clip.warnings.length],
];

/** The state of the table: the column that sorts it, downwards or not, the clips that pass, and the number of rows. */
const view = {column: SHOWN[0], down: true, passing: [], rows: 0};

/** The column of a metric: `of` returns its value of a clip; `beside` are names and functions of values to compare it
 * with, of which the table shows the first.
 */
function columnOf(metric) {
  const {key, judged, factor} = metric;
  const scaled = suffix => clip => (clip[key + suffix] === null ? null : factor * clip[key + suffix]), of = scaled('');
  const beside = [...judged === 'ratio' ? [['source', scaled('_source')]] : [], [COPY, scaled('_copy')]];
  return {...metric, name: nameOf(metric), of, beside,
    cell: clip => [shown(of(clip)), element('small', {}, shown(beside[0][1](clip)))]};
}

/** A duration [s] in words. */
function duration(seconds) {
  const minutes = Math.round(seconds / 60);
  if (seconds < 120) return `${shown(seconds)} s`;
  return minutes < 120 ? `${minutes} min` : `${Math.floor(minutes / 60).toLocaleString('en')} h ${minutes % 60} min`;
}

/** The quantile, at a share from 0 to 1, of the values of clips that are not null; null if there are none. */
function quantile(of, share) {
  const numbers = Float64Array.from(done.map(of).filter(value => value !== null)).sort();
  if (!numbers.length) return null;
  const place = share * (numbers.length - 1), low = Math.floor(place), high = Math.ceil(place);
  return numbers[low] + (place - low) * (numbers[high] - numbers[low]);
}

// ---- head

function buildHead() {
  const failed = clips.length - done.length, number = failed.toLocaleString('en');
  const showFailed = () => {
    $('status').value = 'failed';
    refresh();
    $('clips').scrollIntoView();
  };
  showFacts([
    ['Clips', clips.length.toLocaleString('en')],
    ['Converted', done.length.toLocaleString('en')],
    ['Failed', failed ? button(number, showFailed, {'aria-label': `Show the ${counted(failed, 'clip')} that failed`})
      : number],
    ['Frames', total(done, clip => clip.frames).toLocaleString('en')],
    ['Retargeting', `${duration(total(done, clip => clip.seconds))}, all clips added up`],
    ...batch.targets.length === 1 ? [['Target', batch.targets[0]]] : [],
    ...batch.folder ? [['Folder', batch.folder]] : [],
    ['Made by', `distretarget version ${batch.version}`],
  ]);
  $('terms').append(...terms([...SHOWN.map(({name, explanation}) => [name, explanation]), ['Medians', MEDIANS]]));
  $('metrics').hidden = !done.length;
  $('metrics').append(...SHOWN.map(cardOfColumn));
}

function cardOfColumn(column) {
  const rows = [['worst', quantile(column.of, 1)], ...column.beside.flatMap(([other, its]) => [
    [other, quantile(its, 0.5)], ...other === COPY ? [['copy’s worst', quantile(its, 1)]] : []])];
  const median = shown(quantile(column.of, 0.5));
  return cardOf(column, element('p', {class: 'big'}, median, element('small', {}, ' median')), rows);
}

// ---- player

/** Shows a clip and its result in the player. */
async function watch(clip) {
  $('watched').hidden = false;
  $('watched-name').replaceChildren(nameOfClip(clip));
  await buildPlayer(embedded(`stage-${clip.stage}`));
  if (view.watched) {
    $('reset').click();
    goTo(0);
  }
  view.watched = clip;
  for (const one of document.querySelectorAll('.watch')) one.ariaPressed = one.dataset.stage === String(clip.stage);
}

// ---- table

/** Why a clip failed; only the beginning of a long reason shows until it is opened. */
function reasonOf({error}) {
  if (error.length <= LONG) return element('p', {class: 'reason'}, error);
  return element('details', {class: 'reason'}, element('summary', {}, element('span', {}, error)));
}

/** The name of a clip, which may break into lines after slashes; a link to its report, if it has one. */
function nameOfClip(clip) {
  const parts = clip.clip.split(/(?<=[/\\])/).flatMap(part => [part, element('wbr')]);
  return clip.link === null ? element('span', {}, ...parts) : element('a', {href: clip.link}, ...parts);
}

function nameCell(clip) {
  const attributes = {class: 'watch', 'aria-label': `Play ${clip.clip}`, 'aria-pressed': clip === view.watched,
    'data-stage': clip.stage};
  const play = clip.stage === null ? [] : [button('▶', async () => {
    await watch(clip);
    $('watched').scrollIntoView({block: 'nearest'});
  }, attributes), ' '];
  return element('th', {scope: 'row'}, ...play, nameOfClip(clip));
}

function statusCell(clip) {
  const mark = element('span', {'aria-hidden': 'true'}, clip.done ? '✓ ' : '✗ ');
  return [element('span', {class: clip.done ? 'within' : 'over'}, mark, statusOf(clip))];
}

/** The number of warnings, on a button that shows them in a row below. */
function warningsCell(clip) {
  if (!clip.warnings.length) return ['–'];
  const texts = clip.warnings.map(k => element('li', {}, batch.warnings[k]));
  const row = element('tr', {class: 'told'}, element('td', {colspan: COLUMNS.length}, element('ul', {}, ...texts)));
  const label = `${counted(texts.length, 'warning')} of ${clip.clip}`;
  const opener = button(texts.length, () => {
    const open = !row.isConnected;
    opener.setAttribute('aria-expanded', open);
    if (open) opener.closest('tr').after(row);
    else row.remove();
  }, {'aria-expanded': 'false', 'aria-label': label});
  return [opener];
}

/** The row of a clip; that of a failed one has the reason in place of the metrics. */
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
  return some.toSorted((one, other) => {
    const [p, q] = [column.of(one), column.of(other)];
    return p === null || q === null ? (p === null) - (q === null) : sign * compare(p, q);
  });
}

/** Shows the clips that pass the filters, in order, from the first row. */
function refresh() {
  const words = $('filter').value.toLowerCase().split(/\s+/);
  const [, , passes] = STATUSES.find(([key]) => key === $('status').value);
  const named = clip => {
    const text = `${clip.clip}\n${targetOf(clip)}\n${clip.error || ''}`.toLowerCase();
    return words.every(word => text.includes(word));
  };
  Object.assign(view, {passing: sorted(clips.filter(clip => passes(clip) && named(clip))), rows: 0});
  $('rows').replaceChildren();
  addRows();
  if (!view.rows) $('rows').append(element('tr', {}, element('td', {class: 'words none', colspan: COLUMNS.length},
    clips.length ? 'No clip passes the filters.' : 'There are no clips.')));
}

/** Sorts the table by a column; the same column again reverses the order. */
function sortBy(column, down = column === view.column ? !view.down : !column.text) {
  Object.assign(view, {down, column});
  COLUMNS.forEach((one, k) => {
    $('heads').children[k].ariaSort = one !== column ? null : down ? 'descending' : 'ascending';
  });
  refresh();
}

function buildTable() {
  $('status').append(...STATUSES.map(([key, text, passes]) => (
    new Option(`${text} (${clips.filter(passes).length.toLocaleString('en')})`, key))));
  for (const id of ['filter', 'status']) $(id).addEventListener('input', refresh);
  $('more').addEventListener('click', addRows);
  for (const column of COLUMNS) {
    const [name, unit] = column.name.split(', '), [other] = column.beside?.[0] || [];
    const below = [unit, other?.split(' ').pop()].filter(Boolean).join(' · ');
    const head = button('', () => sortBy(column), column.explanation ? {title: column.explanation} : {});
    head.append(element('span', {}, name), ...below ? [element('small', {}, below)] : []);
    $('heads').append(element('th', {scope: 'col', class: column.text ? 'words' : 'number'}, head));
  }
  sortBy(SHOWN[0], true);
}

buildHead();
buildTable();
followTheme();
const played = clips.find(clip => clip.stage === 0);
if (played) watch(played);
