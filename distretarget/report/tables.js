// The texts and tables: head, figures, worst frames, contacts, explanations.

const D_MEANS = 'Distance of two joints divided by the length of the bones between them: 0 where they coincide, 1 '
  + 'where the path between them is straight.';
const COPY_MEANS = 'The rotation copy: A’s rotations on the bones of B, before anything is corrected.';
const TOUCHING = `Two regions of the body, such as a hand and the head, touch if D of their nearest joints is below `
  + `${drawing.near} and at least ${drawing.far_along} joints lie on the path between them. Regions joined by a bone `
  + 'do not count, nor do two feet while one of them rests.';
const WORST_SHOWN = 2; // frames by each figure

/** A line that says, in words and by a mark, whether a figure is within a limit; `over` is null if it has no value. */
function limitLine(name, limit, over, factor) {
  const most = `${name} ${String(Number((limit * factor).toPrecision(3)))}`;
  if (over === null) return element('p', {class: 'limit'}, most);
  return element('p', {class: over ? 'limit over' : 'limit within'},
    element('span', {'aria-hidden': 'true'}, over ? '✗ ' : '✓ '), `${over ? 'over' : 'within'} ${most}`);
}

/** Whether a figure of B is above the value from which a run needs a look; null if one of the two is missing. */
function needsLook({key}) {
  const value = report.figures.result[key], limit = report.figures.needs_look_above[key];
  return value === null || limit === null ? null : value > limit;
}

function buildFigure(figure) {
  const {key, factor, judged, comparison, whole, missing} = figure, inUnits = judged === 'ratio' ? 1 : factor;
  const {source, result, rotation_copy: copy, needs_look_above: above} = report.figures;
  const value = valueOf(result, key, factor), number = whole ? String(value) : shown(value), look = needsLook(figure);
  const rows = [];
  if (judged !== 'value') rows.push(['A', valueOf(source, key, factor)]);
  if (copy && copy[key] !== null) rows.push(['copy', valueOf(copy, key, factor)]);
  const limits = report.limits.filter(one => one.figure === key);
  if (comparison && limits.length) rows.push([comparison, valueOf(limits[0], 'value', inUnits)]);
  const usual = look === null ? [] : [limitLine('', above[key], look, factor)];
  return element('div', {class: look ? 'figure look' : 'figure'},
    element('h3', {}, term(nameOf(figure), figure.explanation)),
    element('p', {class: value === null ? 'big none' : 'big'}, value === null ? missing : number),
    element('dl', {}, ...terms(rows.map(([what, other]) => [what, shown(other)]))),
    ...usual, ...limits.map(one => limitLine('limit', one.limit, one.value === null ? null : one.over, inUnits)));
}

function counted(number, what) {
  return `${number} ${what}${number === 1 ? '' : 's'}`;
}

function buildHead() {
  const body = ({file, joints, convention}) => `${file}, ${joints} joints${convention ? `, ${convention}` : ''}`;
  const seconds = shown(frameCount * report.frame_time);
  const frames = `${counted(frameCount, 'frame')} of ${shown(1000 * report.frame_time)} ms, ${seconds} s`;
  const ofRun = report.figures.rotation_copy !== null;
  const [roleA, roleB] = ofRun ? ['the source', 'the result'] : ['the reference', 'measured'];
  const facts = [[`A, ${roleA}`, body(report.a)], [`B, ${roleB}`, body(report.b)], ['Frames', frames]];
  const [nameA, nameB] = ['a', 'b'].map(name => element('span', {class: `of-${name}`}, report[name].file));
  $('title').append(...ofRun ? ['result ', nameB, ' against source ', nameA] : [nameB, ' against ', nameA]);
  buildVerdict();
  $('facts').append(...facts.map(pair => element('div', {}, ...terms([pair]))));
  const words = (report.program.command || 'distretarget').split(' ')
    .flatMap((word, k) => [k ? ' ' : '', element('span', {}, word)]);
  $('facts').append(element('div', {class: 'wide'}, element('dt', {}, 'Made by'),
    element('dd', {}, element('code', {}, ...words), ` version ${report.program.version}`)));
  const first = figuresAt('card');
  $('figures').append(...first.map(buildFigure));
  $('other-figures').append(...FIGURES.filter(figure => !first.includes(figure)).map(buildFigure));
  $('terms').append(...terms([
    ...FIGURES.map(figure => [nameOf(figure), figure.explanation]), ['D', D_MEANS], ['Contact', TOUCHING],
    ...report.figures.rotation_copy ? [['Copy', COPY_MEANS]] : [],
  ]));
}

/** What was kept and what changed, and what needs a look; a diff of two files has neither. */
function buildVerdict() {
  $('verdict').hidden = !report.verdict;
  $('verdict').textContent = report.verdict;
  $('looks').hidden = !report.warnings.length;
  $('warnings').append(...report.warnings.map(text => element('li', {}, text)));
}

function buildNotes() {
  const lines = [...report.notes, ...drawing.notes].map(
    note => element('li', {}, `${note[0].toUpperCase()}${note.slice(1)}.`));
  for (const [names, of, other] of [[report.unmatched_b, 'B', 'A'], [report.unmatched_a, 'A', 'B']]) {
    if (!names.length) continue;
    const count = `${counted(names.length, 'joint')} of ${of} without a counterpart in ${other}`;
    lines.push(element('li', {}, names.length <= 6 ? `${count}: ${names.join(', ')}.`
      : element('details', {}, element('summary', {}, count), names.join(', '))));
  }
  $('notes').hidden = !lines.length;
  $('notes').append(element('ul', {}, ...lines));
}

// ---- worst frames

/** The frames of the largest values of a figure, at least half a second apart. */
function worstFrames({key, least}) {
  const order = report.frames.filter(row => row[key] > least).sort((p, q) => q[key] - p[key]);
  const found = [];
  for (const row of order) {
    if (found.every(other => Math.abs(other.frame - row.frame) * frameTime > 0.5)) found.push(row);
    if (found.length === WORST_SHOWN) break;
  }
  return found;
}

/** Adds one picture for each worst frame, with the figures that are worst there. */
function buildWorst() {
  const found = new Map();
  for (const figure of figuresAt('worst frames')) {
    for (const row of worstFrames(figure)) {
      const reason = [nameOf(figure).toLowerCase(), shown(row[figure.key] * figure.factor)];
      found.set(row.frame, [...found.get(row.frame) || [], reason]);
    }
  }
  for (const [frame, reasons] of found) {
    const canvas = element('canvas', {'aria-hidden': 'true'});
    const picture = kept((context, width, height) => {
      const {pair, follow} = state;
      Object.assign(state, {pair: null, follow: true});
      drawScene(context, {x: 0, y: 0, width, height}, frame, [A, B], newCamera());
      Object.assign(state, {pair, follow});
    });
    painted(canvas, () => {
      const {context, width, height} = fitted(canvas);
      picture(context, width, height);
    });
    $('worst').append(element('button', {type: 'button', on: {click: () => goTo(frame)}}, canvas,
      element('b', {}, `Frame ${frame}`),
      ...reasons.map(([name, value]) => element('span', {}, name, element('i', {}, value)))));
  }
  if (!found.size) $('worst').append(element('p', {class: 'none'}, 'B moves like A in every frame.'));
}

// ---- contacts

const SVG = 'http://www.w3.org/2000/svg';

function spanBars(spans, row) {
  return spans.map(([first, end]) => {
    const bar = document.createElementNS(SVG, 'rect');
    const numbers = {x: first, y: row, width: end - first, height: 1, class: row ? 'bar-b' : 'bar-a'};
    Object.entries(numbers).forEach(([name, value]) => bar.setAttribute(name, value));
    return bar;
  });
}

function buildContacts() {
  if (!drawing.contacts.length) {
    $('contacts').append(element('p', {class: 'none'}, 'No two regions of the body touch in A.'));
    return;
  }
  const line = element('i', {class: 'line'});
  for (const [k, {pair, a, b}] of drawing.contacts.entries()) {
    const {regions} = report.contacts[k];
    const bars = document.createElementNS(SVG, 'svg');
    bars.setAttribute('viewBox', `0 0 ${frameCount} 2`);
    bars.setAttribute('preserveAspectRatio', 'none');
    bars.setAttribute('role', 'img');
    const frames = a.reduce((sum, [first, end]) => sum + end - first, 0);
    bars.setAttribute('aria-label', `touch in A in ${frames} frames, ${a.length} times; near in B ${b.length} times`);
    bars.append(...spanBars(a, 0), ...spanBars(b, 1));
    bars.addEventListener('click', () => choose(pair));
    dragFrames(bars);
    const start = a[0][0];
    const show = () => { choose(pair); goTo(start); };
    const name = {type: 'button', class: 'name', on: {click: show}};
    $('contacts').append(element('button', name, regions), element('div', {class: 'track'}, bars));
  }
  const swatch = name => element('i', {class: `swatch bar-${name}`});
  const legend = element('p', {class: 'note'}, swatch('a'), 'in A ', swatch('b'), 'in B; ',
    term('touching', TOUCHING));
  $('contacts').append(line);
  $('contacts').before(legend);
  painted($('contacts'), () => {
    const track = $('contacts').querySelector('.track');
    line.style.left = `${track.offsetLeft + xOf(state.frame + 0.5, track.clientWidth) - 1}px`;
  });
}

// ---- the table of contacts

function contactRow(contact, k) {
  const name = (names, motion) => names.map(joint => joint.slice(motion.namespace.length)).join(' – ');
  const show = () => { choose(drawing.contacts[k].pair); goTo(contact.worst_frame); };
  const numbers = [contact.frames, shown(contact.distance_a), shown(contact.distance_b), shown(contact.error)];
  const label = `Go to frame ${contact.worst_frame}, ${contact.regions}`;
  const go = {type: 'button', 'aria-label': label, on: {click: show}};
  return element('tr', {},
    element('th', {scope: 'row'}, contact.regions, element('small', {}, name(contact.joints_b, B))),
    ...numbers.map(text => element('td', {}, text)),
    element('td', {}, element('button', go, contact.worst_frame)));
}

function buildContactTable() {
  if (!report.contacts.length) return;
  const heads = [['Regions', 'Two regions of the body, and their joints that are nearest in A in the worst frame.'],
    ['Frames', 'In how many frames they touch in A.'], ['D in A', D_MEANS], ['D in B', D_MEANS],
    ['Error', 'Mean |D in A − D in B| over the frames of contact.'],
    ['Worst', 'The frame of the largest error.']];
  $('contact-table').append(element('table', {},
    element('thead', {}, element('tr', {},
      ...heads.map(([name, text]) => element('th', {scope: 'col'}, term(name, text))))),
    element('tbody', {}, ...report.contacts.map(contactRow))));
}

// ---- all of it

function start() {
  buildHead();
  buildNotes();
  buildPlayer();
  figuresAt('curve').forEach(buildCurve);
  buildWorst();
  buildMatrices();
  buildContacts();
  buildContactTable();
  addEventListener('beforeprint', () => setPlaying(false));
  followTheme();
}

start();
