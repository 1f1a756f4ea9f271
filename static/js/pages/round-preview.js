// The kitchen of the coming round, with both chefs at their starting places.

/** @import { Player } from '../board/kitchen.js' */

import { NORTH, cellsOf } from '../board/kitchen.js';
import { Scene } from '../board/scene.js';
import { find } from '../browser/dom.js';

const canvas = find('#scene', HTMLCanvasElement);
const { grid: rows, you, seat } = canvas.dataset;
/** @type {string[]} */
const grid = JSON.parse(rows ?? '[]');
/** @type {Player[]} */
const players = ['1', '2'].map((digit) => [...cellsOf(grid, digit)[0], NORTH, 0]);
const scene = await Scene.open(canvas, you ?? '');
scene.show(grid, { players }, Number(seat));
