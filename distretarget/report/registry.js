// The metrics, whose registry the page has as data.

import {embedded} from './dom.js';

export const METRICS = embedded('registry');

export function metricsAt(place) {
  return METRICS.filter(({places}) => places.includes(place));
}

/** What a metric is called, with the unit that the page shows it in. */
export function nameOf({label, symbol}) {
  return symbol ? `${label}, ${symbol}` : label;
}
