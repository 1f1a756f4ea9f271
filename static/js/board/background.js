// Paints the static parts of a kitchen: floor, counters with their fronts, stations. Units: 1/64 cell.

/** @import { Grid } from './kitchen.js' */
/** @import { Sprites } from './sprites.js' */

import { context2d } from '../browser/dom.js';
import { isFloor } from './kitchen.js';
import { blank } from './sprites.js';

/** @typedef {CanvasRenderingContext2D} Context */
/** @typedef {(name: string, x: number, y: number, side: number) => void} Put draws a sprite */

export const CELL = 64;
/** @type {Record<string, string>} */
const STATIONS = { O: 'station-onion', D: 'station-dish', S: 'station-serve' };
const WOOD = '#cfa574';
const EDGE_LIGHT = '#e3c195';
const EDGE_DARK = '#a87c4c';
const SHADE = '34, 48, 60';

/**
 * Return the background as a canvas.
 * @param {Grid} grid
 * @param {Sprites} sprites
 * @param {number} cellPixels device pixels of a cell (a whole number)
 */
export function paintBackground(grid, sprites, cellPixels) {
  const canvas = blank(grid[0].length * cellPixels, grid.length * cellPixels);
  const context = context2d(canvas, { alpha: false });
  const scale = cellPixels / CELL;
  context.scale(scale, scale);
  context.fillStyle = WOOD;
  context.fillRect(0, 0, canvas.width / scale, canvas.height / scale);
  /** @type {Put} */
  const put = (name, x, y, side) => context.drawImage(sprites.at(name, side * scale), x, y, side, side);
  const cells = grid.flatMap((row, y) => [...row].map((tile, x) => ({ tile, x, y, floor: isFloor(grid, x, y) })));
  for (const { x, y, floor } of cells) if (floor) paintFloor(context, put, grid, x, y);
  for (const { x, y, floor } of cells) if (!floor) put(counterAt(grid, x, y), x * CELL, y * CELL, CELL);
  for (const { x, y, floor } of cells) if (!floor) paintEdges(context, grid, x, y);
  for (const { x, y, tile } of cells) if (STATIONS[tile]) paintStation(context, put, tile, x, y);
  return canvas;
}

/** @type {(grid: Grid, x: number, y: number) => string} */
function counterAt(grid, x, y) {
  return y === grid.length - 1 || isFloor(grid, x, y + 1) ? 'counter-front' : 'counter';
}

/** @type {(context: Context, put: Put, grid: Grid, x: number, y: number) => void} */
function paintFloor(context, put, grid, x, y) {
  const left = x * CELL;
  const top = y * CELL;
  put((x + y) % 2 ? 'floor-b' : 'floor-a', left, top, CELL);
  if (!isFloor(grid, x, y - 1)) shade(context, [left, top, CELL, 15], [0, top, 0, top + 15], 0.2);
  if (!isFloor(grid, x - 1, y)) shade(context, [left, top, 8, CELL], [left, 0, left + 8, 0], 0.12);
  if (!isFloor(grid, x + 1, y)) {
    shade(context, [left + CELL - 4, top, 4, CELL], [left + CELL, 0, left + CELL - 4, 0], 0.07);
  }
}

/** @typedef {[number, number, number, number]} Four */

/**
 * Draw the soft shadow that a counter throws on the floor next to it.
 * @type {(context: Context, box: Four, line: Four, strength: number) => void}
 */
function shade(context, box, line, strength) {
  const fade = context.createLinearGradient(...line);
  fade.addColorStop(0, `rgba(${SHADE}, ${strength})`);
  fade.addColorStop(1, `rgba(${SHADE}, 0)`);
  context.fillStyle = fade;
  context.fillRect(...box);
}

/** @type {(context: Context, grid: Grid, x: number, y: number) => void} */
function paintEdges(context, grid, x, y) {
  const left = x * CELL;
  const top = y * CELL;
  const right = left + CELL;
  if (isFloor(grid, x, y - 1)) bar(context, [left, top + 1, right, top + 1], EDGE_LIGHT);
  if (isFloor(grid, x - 1, y)) bar(context, [left + 1, top, left + 1, top + CELL], EDGE_DARK);
  if (isFloor(grid, x + 1, y)) bar(context, [right - 1, top, right - 1, top + CELL], EDGE_DARK);
}

/** @type {(context: Context, line: Four, paint: string) => void} */
function bar(context, [x1, y1, x2, y2], paint) {
  context.strokeStyle = paint;
  context.lineWidth = 2.4;
  context.lineCap = 'round';
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}

/** @type {(context: Context, put: Put, tile: string, x: number, y: number) => void} */
function paintStation(context, put, tile, x, y) {
  if (tile !== 'S') contactShadow(context, x * CELL + 32, y * CELL + 54, 25);
  put(STATIONS[tile], x * CELL + 3, y * CELL, CELL - 6);
}

/**
 * Draw the soft dark patch below something that stands on a surface.
 * @type {(context: Context, x: number, y: number, radius: number) => void}
 */
export function contactShadow(context, x, y, radius) {
  context.fillStyle = `rgba(${SHADE}, .16)`;
  context.beginPath();
  context.ellipse(x, y, radius, radius * 0.2, 0, 0, 2 * Math.PI);
  context.fill();
}
