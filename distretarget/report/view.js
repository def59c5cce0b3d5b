// A page with files in a player.

import {followTheme} from './dom.js';
import {buildPlayer} from './player.js';

followTheme();
buildPlayer();
