// The report on a clip: head, cards, curves and contacts below the player.

import {$, counted, element, embedded, followTheme, onTheme, showFacts, shown, terms} from './dom.js';
import {METRICS, metricsAt, nameOf} from './registry.js';
import {showCards} from './cards.js';
import {showCurve} from './curves.js';
import {clock, goTo, repaint} from './playback.js';
import {buildPlayer} from './player.js';
import {tableOf} from './tables.js';

const report = embedded('document');
const D_MEANS = 'Distance of two joints divided by the length of the bones between them: 0 where they coincide, 1 '
  + 'where the path between them is straight.';
const COPY_MEANS = 'The rotation copy: A’s rotations on the bones of B, before anything is corrected.';

function buildHead() {
  const body = ({file, joints, convention}) => `${file}, ${joints} joints${convention ? `, ${convention}` : ''}`;
  const seconds = shown(report.frame_count * report.frame_time);
  const frames = `${counted(report.frame_count, 'frame')} of ${shown(1000 * report.frame_time)} ms, ${seconds} s`;
  const ofRun = report.metrics.rotation_copy !== null;
  const [roleA, roleB] = ofRun ? ['the source', 'the result'] : ['the reference', 'measured'];
  const [nameA, nameB] = ['a', 'b'].map(name => element('span', {class: `of-${name}`}, report[name].file));
  $('title').append(...ofRun ? ['result ', nameB, ' against source ', nameA] : [nameB, ' against ', nameA]);
  $('verdict').hidden = !report.verdict;
  $('verdict').textContent = report.verdict;
  $('looks').hidden = !report.warnings.length;
  $('warnings').append(...report.warnings.map(text => element('li', {}, text)));
  showFacts([[`A, ${roleA}`, body(report.a)], [`B, ${roleB}`, body(report.b)], ['Frames', frames]]);
  const words = (report.program.command || 'distretarget').split(' ').flatMap(
    (word, k) => [k ? ' ' : '', element('span', {}, word)]);
  $('facts').append(element('div', {class: 'wide'}, element('dt', {}, 'Made by'),
    element('dd', {}, element('code', {}, ...words), ` version ${report.program.version}`)));
  $('terms').append(...terms([...METRICS.map(metric => [nameOf(metric), metric.explanation]), ['D', D_MEANS],
    ['Contact', report.touching], ...report.metrics.rotation_copy ? [['Copy', COPY_MEANS]] : []]));
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
  showCards(report);
  followTheme();
  await buildPlayer();
  const contacts = embedded('contact-table');
  $('contacts').append(contacts.rows.length ? tableOf(contacts)
    : element('p', {class: 'none'}, 'No two regions of the body touch in A.'));
  const columns = embedded('columns');
  for (const metric of metricsAt('curve')) await showCurve(metric, columns);
  buildWorst();
}

start();
