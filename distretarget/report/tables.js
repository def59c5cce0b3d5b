// Tables, in which frames are buttons that go there.

import {button, element} from './dom.js';
import {goTo} from './playback.js';

function cellOf(content, name) {
  const label = {'aria-label': `Go to frame ${content}`};
  const shown = typeof content === 'string' ? content : button(content, () => goTo(content), label);
  return element('td', {'data-name': name}, shown);
}

/** A table of texts and frames; on a narrow screen each row becomes a list. */
export function tableOf({columns, rows}) {
  return element('div', {class: 'table'}, element('table', {class: 'stacked'},
    element('thead', {}, element('tr', {}, ...columns.map(name => element('th', {scope: 'col'}, name)))),
    element('tbody', {}, ...rows.map(([first, ...others]) => element('tr', {},
      element('th', {scope: 'row'}, first), ...others.map((cell, k) => cellOf(cell, columns[k + 1])))))));
}
