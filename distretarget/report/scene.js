// The report on a scene, and the page of `distretarget view`: a player, and tables below it.

import {$, element, embedded, followTheme} from './dom.js';
import {buildPlayer} from './player.js';
import {tableOf} from './tables.js';

for (const table of embedded('numbers')) {
  $('tables').append(element('section', {}, element('h2', {}, table.title), tableOf(table)));
}
followTheme();
buildPlayer();
