// The kitchen of the coming round, with both chefs at their starting places.

import { cellsOf, NORTH } from '../board/kitchen.js';
import { Scene } from '../board/scene.js';

const canvas = document.getElementById('scene');
const grid = JSON.parse(canvas.dataset.grid);
const players = ['1', '2'].map((digit) => [...cellsOf(grid, digit)[0], NORTH, 0]);
const scene = await Scene.open(canvas, canvas.dataset.you);
scene.show(grid, { players }, Number(canvas.dataset.seat));
