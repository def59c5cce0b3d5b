// The registry of metrics, from the data of the page, and cards for metrics.

import {element, embedded, shown, terms} from './dom.js';

export const METRICS = embedded('registry');
const FLAT = 1e-9; // values of a metric below this are rounding errors, and are shown as 0

export const metricsAt = place => METRICS.filter(({places}) => places.includes(place));

/** The name of a metric, with its unit in the page. */
export const nameOf = ({label, symbol}) => (symbol ? `${label}, ${symbol}` : label);

/** A number times the factor of its metric; null where nothing was measured. */
export function scaled(value, factor) {
  if (value === null || value === undefined || Number.isNaN(value)) return null;
  return Math.abs(value * factor) < FLAT ? 0 : value * factor;
}

/** The name of a metric, with its explanation as a tooltip; the glossary below has it, too. */
export const named = metric => element('abbr', {title: metric.explanation}, nameOf(metric));

/** The card of a metric: `big`, its value, `rows`, values to compare it with, and lines below; `look` highlights it. */
export function cardOf(metric, big, rows, lines = [], look = false) {
  return element('div', {class: look ? 'metric look' : 'metric'}, element('h3', {}, named(metric)), big,
    element('dl', {}, ...terms(rows.map(([what, value]) => [what, shown(value)]))), ...lines);
}
