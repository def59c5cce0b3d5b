// The cards of a clip's metrics.

import {$, element, shown, term, terms} from './dom.js';
import {METRICS, metricsAt, nameOf} from './registry.js';

const FLAT = 1e-9; // values of a metric below this are rounding errors, and are shown as 0

/** A number times the factor of the page; null where nothing was to be measured. */
function scaled(value, factor) {
  if (value === null || value === undefined || Number.isNaN(value)) return null;
  return Math.abs(value * factor) < FLAT ? 0 : value * factor;
}

/** A line that says, in words and by a mark, whether a metric is within a limit; `over` is null if it has no value. */
function limitLine(name, limit, over, factor) {
  const most = `${name} ${String(Number((limit * factor).toPrecision(3)))}`;
  if (over === null) return element('p', {class: 'limit'}, most);
  return element('p', {class: over ? 'limit over' : 'limit within'},
    element('span', {'aria-hidden': 'true'}, over ? '✗ ' : '✓ '), `${over ? 'over' : 'within'} ${most}`);
}

function cardOf(report, metric) {
  const {key, factor, judged, comparison, whole, missing, instead} = metric, inUnits = judged === 'ratio' ? 1 : factor;
  const {source, result, rotation_copy: copy, limits: above} = report.metrics;
  const value = scaled(result[key], factor), number = whole ? String(value) : shown(value);
  const unjudged = result[key] === null || above[key] === null || (result[instead] ?? null) !== null;
  const look = unjudged ? null : result[key] > above[key];
  const rows = [];
  if (judged !== 'value') rows.push(['A', scaled(source[key], factor)]);
  if (copy && scaled(copy[key], 1) !== null) rows.push(['copy', scaled(copy[key], factor)]);
  const limits = report.limits.filter(one => one.metric === key);
  if (comparison && limits.length) rows.push([comparison, scaled(limits[0].value, inUnits)]);
  const usual = unjudged ? [] : [limitLine('', above[key], look, factor)];
  return element('div', {class: look ? 'metric look' : 'metric'},
    element('h3', {}, term(nameOf(metric), metric.explanation)),
    element('p', {class: value === null ? 'big none' : 'big'}, value === null ? missing : number),
    element('dl', {}, ...terms(rows.map(([what, other]) => [what, shown(other)]))),
    ...usual, ...limits.map(one => limitLine('limit', one.limit, one.value === null ? null : one.over, inUnits)));
}

/** Shows a card for each metric of a clip, first those that matter most. */
export function showCards(report) {
  const first = metricsAt('card');
  $('metrics').append(...first.map(metric => cardOf(report, metric)));
  $('other-metrics').append(...METRICS.filter(one => !first.includes(one)).map(metric => cardOf(report, metric)));
}
