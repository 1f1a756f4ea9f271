// The grid of a kitchen as plain data: drawing in it, its size, and its undo history. The rules are on the server.

/** @import { Cell, Grid } from '../board/kitchen.js' */

export const MIN_SIDE = 3;
export const MAX_SIDE = 32;
export const TILES = [' ', 'X', 'O', 'D', 'P', 'S', '1', '2'];
/** @type {Record<string, string>} */
export const TILE_NAMES = {
  ' ': 'floor',
  X: 'counter',
  O: 'onions',
  D: 'dishes',
  P: 'pot',
  S: 'serving',
  1: 'start of the blue chef',
  2: 'start of the green chef',
};
const MAX_UNDO = 500;

/**
 * Return the grid with `tile` on some cells. A chef has one start: its old one becomes floor.
 * @param {Grid} grid
 * @param {Cell[]} cells
 * @param {string} tile
 * @returns {Grid}
 */
export function drawn(grid, cells, tile) {
  const isChef = tile === '1' || tile === '2';
  const places = isChef ? cells.slice(-1) : cells;
  const letters = grid.map((row) => [...(isChef ? row.replaceAll(tile, ' ') : row)]);
  for (const [x, y] of places) if (letters[y]?.[x] !== undefined) letters[y][x] = tile;
  return letters.map((row) => row.join(''));
}

/**
 * Return the grid with another size: columns and rows are added or removed next to the right and the lower border.
 * @param {Grid} grid
 * @param {number} columns
 * @param {number} rows
 * @returns {Grid}
 */
export function resized(grid, columns, rows) {
  const wide = grid.map((row, y) => {
    const more = columns - row.length;
    const isBorder = y === 0 || y === grid.length - 1;
    if (more >= 0) return row.slice(0, -1) + (isBorder ? 'X' : ' ').repeat(more) + row.slice(-1);
    return row.slice(0, columns - 1) + row.slice(-1);
  });
  const last = wide[wide.length - 1];
  if (rows >= wide.length) {
    const floor = `X${' '.repeat(columns - 2)}X`;
    return [...wide.slice(0, -1), ...Array(rows - wide.length).fill(floor), last];
  }
  return [...wide.slice(0, rows - 1), last];
}

/**
 * Return the cells on the line from one to another, both included: those that a pointer passed between two events.
 * @param {Cell} from
 * @param {Cell} to
 * @returns {Cell[]}
 */
export function between([fromX, fromY], [toX, toY]) {
  const steps = Math.max(Math.abs(toX - fromX), Math.abs(toY - fromY), 1);
  return Array.from({ length: steps + 1 }, (_, step) => [
    Math.round(fromX + ((toX - fromX) * step) / steps),
    Math.round(fromY + ((toY - fromY) * step) / steps),
  ]);
}

/**
 * Return rows of a file as a grid: short rows are filled up with counters.
 * @param {string[]} rows
 * @returns {Grid}
 */
export function filledUp(rows) {
  const columns = Math.min(MAX_SIDE, Math.max(MIN_SIDE, ...rows.map((row) => row.length)));
  return rows.slice(0, MAX_SIDE).map((row) => row.slice(0, columns).padEnd(columns, 'X'));
}

/** The grids that were drawn one after the other. */
export class UndoList {
  /** @param {Grid} grid */
  constructor(grid) {
    this.now = grid;
    /** @type {Grid[]} */
    this.before = [];
    /** @type {Grid[]} */
    this.after = [];
  }

  /**
   * Add a grid; false if it is as the one before.
   * @param {Grid} grid
   */
  add(grid) {
    if (grid.join('\n') === this.now.join('\n')) return false;
    this.before = [...this.before, this.now].slice(-MAX_UNDO);
    this.after = [];
    this.now = grid;
    return true;
  }

  undo() {
    const grid = this.before.pop();
    if (!grid) return false;
    this.after.push(this.now);
    this.now = grid;
    return true;
  }

  redo() {
    const grid = this.after.pop();
    if (!grid) return false;
    this.before.push(this.now);
    this.now = grid;
    return true;
  }
}
