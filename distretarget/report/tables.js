// What is written: head, figures, worst frames, contacts, worst pairs, explanations.

const TERMS = {
  stress: 'How far the distances between all joints are off those of A, over the squared height of B (Eq. 2 of the paper). 0 is best.',
  contact_error: `Mean |D in A − D in B| over the pairs that touch in A: D below ${scene.near}, at least ${scene.far_along} joints along the path. 0 is best.`,
  direction_error: 'The angle between corresponding bones of A and B, mean over bones [degrees]; p99 is exceeded by 1 in 100. 0 is best.',
  slide: 'Horizontal speed of ankles and toes while they are at rest in A [leg lengths per second]. As A is best.',
  foot_height: 'Height of ankles and toes over the origin while they are at rest in A [% of leg length]. As A is best.',
  jerk: 'Roughness: mean third difference of the positions of the joints [body sizes / s³]. As A is best.',
  bone_error: 'The largest relative error of a bone’s length against B’s skeleton [%]. 0 is best.',
  turn: 'The most by which a joint of B turns further in one frame than that of A [degrees].',
  D: 'Distance of two joints divided by the length of the bones between them: 0 where they coincide, 1 where the path between them is straight.',
};
const FIGURES = [
  {name: 'Stress × 1000', term: 'stress', field: 'stress', factor: 1000},
  {name: 'Contact error', term: 'contact_error', field: 'contact_error', none: 'no contacts in A'},
  {name: 'Direction error, °', term: 'direction_error', field: 'direction_error', p99: 'direction_error_p99', none: 'no bones in common'},
  {name: 'Slide, legs/s', term: 'slide', field: 'slide_b', a: 'slide_a', none: 'no feet at rest in A'},
  {name: 'Foot height, % leg', term: 'foot_height', field: 'foot_height_b', a: 'foot_height_a', none: 'no feet at rest in A'},
  {name: 'Jerk, sizes/s³', term: 'jerk', field: 'jerk_b', a: 'jerk_a', none: 'under four frames'},
  {name: 'Bone error, %', term: 'bone_error', field: 'bone_error', factor: 100},
  {name: 'Largest turn, °', term: 'turn', field: 'turn', none: 'only one frame'},
];
const PAIRS_SHOWN = 15;

function figureOf(summary, field, factor) {
  const value = summary[field];
  return value === null ? null : Math.abs(value * factor) < FLAT ? 0 : value * factor;
}

function buildFigure({name, term: key, field, a, p99, factor = 1, none}) {
  const {summary, rotation_copy: copy} = report;
  const value = figureOf(summary, field, factor);
  const rows = [];
  if (a) rows.push(['A', figureOf(summary, a, factor)]);
  if (copy) rows.push(['rotation copy', figureOf(copy, field, factor)]);
  if (p99) rows.push(['p99', figureOf(summary, p99, factor)]);
  return element('div', {class: 'figure'},
    element('h3', {}, term(name, TERMS[key])),
    element('p', {class: value === null ? 'big none' : 'big'}, value === null ? none : shown(value)),
    element('dl', {}, ...rows.flatMap(([what, number]) => [element('dt', {}, what), element('dd', {}, shown(number))])));
}

function buildHead() {
  const body = ({file, joints, convention}) => `${file}, ${joints} joints${convention ? `, ${convention}` : ''}`;
  const frames = `${frameCount} ${frameCount === 1 ? 'frame' : 'frames'} of ${shown(1000 * report.frame_time)} ms, ${shown(frameCount * report.frame_time)} s`;
  const facts = [['A, the reference', body(report.a)], ['B, measured', body(report.b)], ['Frames', frames]];
  $('title').append(element('span', {class: 'of-b'}, report.b.file), ' against ', element('span', {class: 'of-a'}, report.a.file));
  $('facts').append(...facts.map(([name, text]) => element('div', {}, element('dt', {}, name), element('dd', {}, text))));
  $('facts').append(element('div', {class: 'wide'}, element('dt', {}, 'Made by'),
    element('dd', {}, `distretarget ${report.program.version} `, element('code', {}, report.program.command))));
  $('figures').append(...FIGURES.map(buildFigure));
  $('terms').append(...[...FIGURES.map(({name, term: key}) => [name, key]), ['D', 'D']].flatMap(
    ([name, key]) => [element('dt', {}, name), element('dd', {}, TERMS[key])]));
}

function buildNotes() {
  const lines = [...report.notes, ...scene.notes].map(note => element('li', {}, `${note[0].toUpperCase()}${note.slice(1)}.`));
  for (const [names, text] of [[report.unmatched_b, 'of B have no counterpart in A'], [report.unmatched_a, 'of A have no counterpart in B']]) {
    if (!names.length) continue;
    const count = `${names.length} ${names.length === 1 ? 'joint' : 'joints'} ${text.replace('have', names.length === 1 ? 'has' : 'have')}`;
    lines.push(element('li', {}, names.length <= 6 ? `${count}: ${names.join(', ')}.`
      : element('details', {}, element('summary', {}, count), names.join(', '))));
  }
  $('notes').hidden = !lines.length;
  $('notes').append(element('ul', {}, ...lines));
}

// ---- worst frames

/** The frames of the largest values of a curve, at least half a second apart. */
function worstFrames({field, factor, least}, most) {
  const order = report.frames.filter(row => row[field] * factor > least).sort((p, q) => q[field] - p[field]);
  const found = [];
  for (const row of order) {
    if (found.every(other => Math.abs(other.frame - row.frame) * frameTime > 0.5)) found.push(row);
    if (found.length === most) break;
  }
  return found;
}

/** One picture for each worst frame, with what is worst in it. */
function buildWorst() {
  const found = new Map();
  for (const curve of CURVES.filter(one => one.worst)) {
    const field = curve.lines[curve.lines.length - 1][0];
    for (const row of worstFrames({...curve, field}, curve.worst)) {
      const reason = [curve.name.toLowerCase(), shown(row[field] * curve.factor)];
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
      element('b', {}, `Frame ${frame}`), ...reasons.map(([name, value]) => element('span', {}, name, element('i', {}, value)))));
  }
  if (!found.size) $('worst').append(element('p', {class: 'none'}, 'B does as A in every frame.'));
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
  if (!scene.contacts.length) {
    $('contacts').append(element('p', {class: 'none'}, 'No two joints touch in A.'));
    return;
  }
  const line = element('i', {class: 'line'});
  for (const {pair, a, b} of scene.contacts) {
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
    $('contacts').append(element('button', {type: 'button', class: 'name', on: {click: show}, title: pairName(pair)}, pairName(pair)),
      element('div', {class: 'track'}, bars));
  }
  const legend = element('p', {class: 'note'}, element('i', {class: 'swatch bar-a'}), 'in A ', element('i', {class: 'swatch bar-b'}), 'in B; ',
    term('touching', TERMS.contact_error), scene.contacts.length === 24 ? ': the 24 pairs that do so longest' : '');
  $('contacts').append(line);
  $('contacts').before(legend);
  painted($('contacts'), () => {
    const track = $('contacts').querySelector('.track');
    line.style.left = `${track.offsetLeft + xOf(state.frame + 0.5, track.clientWidth) - 1}px`;
  });
}

// ---- worst pairs

function pairRow(pair, k) {
  const points = scene.pairs[k];
  const name = names => names.join(' – ');
  const show = () => { choose(points); goTo(pair.worst_frame); };
  const same = name(pair.joints_a) === name(pair.joints_b);
  const numbers = [pair.contact_frames || '–', shown(pair.distance_a), shown(pair.distance_b), shown(pair.error)];
  const row = element('tr', k >= PAIRS_SHOWN ? {class: 'more'} : {},
    element('th', {scope: 'row'}, name(pair.joints_b), same ? '' : element('small', {}, name(pair.joints_a))),
    ...numbers.map(text => element('td', {}, text)),
    element('td', {}, element('button', {type: 'button', 'aria-label': `Go to frame ${pair.worst_frame}, ${name(pair.joints_b)}`,
      on: {click: show}}, pair.worst_frame)));
  return row;
}

function buildPairs() {
  if (!report.pairs.length) {
    $('pairs').append(element('p', {class: 'none'}, 'A and B have no pairs of joints in common.'));
    return;
  }
  const heads = [['Joints', 'The joints in B, and, where they are called otherwise, in A.'],
    ['Contact', 'In how many frames they touch in A.'], ['D in A', TERMS.D], ['D in B', TERMS.D],
    ['Error', 'Mean |D in A − D in B|, over the frames of contact where there are any.'],
    ['Worst', 'The frame of the largest error.']];
  const table = element('table', {},
    element('thead', {}, element('tr', {}, ...heads.map(([name, text]) => element('th', {scope: 'col'}, term(name, text))))),
    element('tbody', {}, ...report.pairs.map(pairRow)));
  $('pairs').append(table);
  if (report.pairs.length > PAIRS_SHOWN) {
    const more = element('button', {type: 'button', 'aria-expanded': 'false', on: {click: () => {
      const open = table.classList.toggle('all');
      more.setAttribute('aria-expanded', open);
      more.textContent = open ? `Show ${PAIRS_SHOWN}` : `Show all ${report.pairs.length}`;
    }}}, `Show all ${report.pairs.length}`);
    $('pairs').append(more);
  }
}

// ---- all of it

function printing(on) {
  const root = document.documentElement;
  if (on) {
    setPlaying(false);
    Object.assign(printing, {theme: root.dataset.theme, open: $('glossary').open});
    root.dataset.theme = 'light';
  } else if (printing.theme) root.dataset.theme = printing.theme;
  else delete root.dataset.theme;
  $('glossary').open = on || printing.open;
  readColours();
  paintAll();
}

function start() {
  buildHead();
  buildNotes();
  buildPlayer();
  CURVES.forEach(buildCurve);
  buildWorst();
  buildMatrices();
  buildContacts();
  buildPairs();
  setTheme();
  $('theme').addEventListener('click', () => setTheme(isDark() ? 'light' : 'dark'));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => setTheme());
  addEventListener('beforeprint', () => printing(true));
  addEventListener('afterprint', () => printing(false));
}

start();
