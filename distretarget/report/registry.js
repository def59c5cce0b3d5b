// The figures of quality, whose registry the page has as data.

import {embedded} from './dom.js';

export const FIGURES = embedded('registry');

export function figuresAt(place) {
  return FIGURES.filter(({places}) => places.includes(place));
}

/** What a figure is called, with the unit that the page shows it in. */
export function nameOf({label, symbol}) {
  return symbol ? `${label}, ${symbol}` : label;
}
