// The report on a scene: tables below the player.

import {$, button, element, embedded, followTheme} from './dom.js';
import {buildPlayer} from './player.js';
import {goTo} from './playback.js';

/** A cell with a text, or, of the number of a frame, with a button that goes there. */
function cellOf(content, name) {
  if (typeof content === 'string') return element('td', {'data-name': name}, content);
  const label = {'aria-label': `Go to frame ${content}`};
  return element('td', {'data-name': name}, button(content, () => goTo(content), label));
}

function tableOf({title, columns, rows}) {
  return element('section', {}, element('h2', {}, title),
    element('div', {class: 'table'}, element('table', {class: 'stacked'},
      element('thead', {}, element('tr', {}, ...columns.map(name => element('th', {scope: 'col'}, name)))),
      element('tbody', {}, ...rows.map(([first, ...others]) => element('tr', {},
        element('th', {scope: 'row'}, first), ...others.map((cell, k) => cellOf(cell, columns[k + 1]))))))));
}

$('tables').append(...embedded('numbers').map(tableOf));
followTheme();
buildPlayer();
