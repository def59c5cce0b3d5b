// The metrics, whose registry the page has as data, and their cards.

import {element, embedded, shown, terms} from './dom.js';

export const METRICS = embedded('registry');
const FLAT = 1e-9; // values of a metric below this are rounding errors, and are shown as 0

export const metricsAt = place => METRICS.filter(({places}) => places.includes(place));

/** What a metric is called, with the unit that the page shows it in. */
export const nameOf = ({label, symbol}) => (symbol ? `${label}, ${symbol}` : label);

/** A number times the factor of the page; null where nothing was to be measured. */
export function scaled(value, factor) {
  if (value === null || value === undefined || Number.isNaN(value)) return null;
  return Math.abs(value * factor) < FLAT ? 0 : value * factor;
}

/** The name of a metric, with its explanation for those who point at it; the glossary below has it for all. */
export const named = metric => element('abbr', {title: metric.explanation}, nameOf(metric));

/** A card: a metric, its value in large, the values to compare it with, and lines below. */
export function cardOf(metric, big, rows, lines = [], look = false) {
  return element('div', {class: look ? 'metric look' : 'metric'}, element('h3', {}, named(metric)), big,
    element('dl', {}, ...terms(rows.map(([what, value]) => [what, shown(value)]))), ...lines);
}
