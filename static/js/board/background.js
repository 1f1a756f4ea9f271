// What never moves in a kitchen: floor, counters with their fronts, stations; painted once for each size. Units: 1/64 cell.

import { isFloor } from './kitchen.js';
import { blank } from './sprites.js';

export const CELL = 64;
const STATIONS = { O: 'station-onion', D: 'station-dish', S: 'station-serve' };
const WOOD = '#cfa574', EDGE_LIGHT = '#e3c195', EDGE_DARK = '#a87c4c', SHADE = '34, 48, 60';

/** The still kitchen as a canvas; `cellPixels`: device pixels of a cell (whole number). */
export function paintBoard(grid, sprites, cellPixels) {
  const canvas = blank(grid[0].length * cellPixels, grid.length * cellPixels);
  const context = canvas.getContext('2d', { alpha: false });
  const scale = cellPixels / CELL;
  context.scale(scale, scale);
  context.fillStyle = WOOD;
  context.fillRect(0, 0, canvas.width / scale, canvas.height / scale);
  const cells = grid.flatMap((row, y) => [...row].map((tile, x) => [tile, x, y]));
  const put = (name, x, y, side) => context.drawImage(sprites.at(name, side * scale), x, y, side, side);
  for (const [, x, y] of cells) if (isFloor(grid, x, y)) floor(context, put, grid, x, y);
  for (const [, x, y] of cells) if (!isFloor(grid, x, y)) put(frontOrTop(grid, x, y), x * CELL, y * CELL, CELL);
  for (const [, x, y] of cells) if (!isFloor(grid, x, y)) edges(context, grid, x, y);
  for (const [tile, x, y] of cells) if (STATIONS[tile]) station(context, put, tile, x, y);
  return canvas;
}

function frontOrTop(grid, x, y) {
  return y === grid.length - 1 || isFloor(grid, x, y + 1) ? 'counter-front' : 'counter';
}

function floor(context, put, grid, x, y) {
  const left = x * CELL, top = y * CELL;
  put((x + y) % 2 ? 'floor-b' : 'floor-a', left, top, CELL);
  if (!isFloor(grid, x, y - 1)) shade(context, [left, top, CELL, 15], [0, top, 0, top + 15], 0.2);
  if (!isFloor(grid, x - 1, y)) shade(context, [left, top, 8, CELL], [left, 0, left + 8, 0], 0.12);
  if (!isFloor(grid, x + 1, y)) shade(context, [left + CELL - 4, top, 4, CELL], [left + CELL, 0, left + CELL - 4, 0], 0.07);
}

/** A soft shadow that a counter throws on the floor beside it. */
function shade(context, box, line, strength) {
  const fade = context.createLinearGradient(...line);
  fade.addColorStop(0, `rgba(${SHADE}, ${strength})`);
  fade.addColorStop(1, `rgba(${SHADE}, 0)`);
  context.fillStyle = fade;
  context.fillRect(...box);
}

function edges(context, grid, x, y) {
  const left = x * CELL, top = y * CELL, right = left + CELL;
  if (isFloor(grid, x, y - 1)) bar(context, left, top + 1, right, top + 1, EDGE_LIGHT);
  if (isFloor(grid, x - 1, y)) bar(context, left + 1, top, left + 1, top + CELL, EDGE_DARK);
  if (isFloor(grid, x + 1, y)) bar(context, right - 1, top, right - 1, top + CELL, EDGE_DARK);
}

function bar(context, x1, y1, x2, y2, paint) {
  context.strokeStyle = paint;
  context.lineWidth = 2.4;
  context.lineCap = 'round';
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}

function station(context, put, tile, x, y) {
  if (tile !== 'S') contactShadow(context, x * CELL + 32, y * CELL + 54, 25);
  put(STATIONS[tile], x * CELL + 3, y * CELL, CELL - 6);
}

/** The soft dark spot below something that stands on a surface. */
export function contactShadow(context, x, y, radius) {
  context.fillStyle = `rgba(${SHADE}, .16)`;
  context.beginPath();
  context.ellipse(x, y, radius, radius * 0.2, 0, 0, 2 * Math.PI);
  context.fill();
}
