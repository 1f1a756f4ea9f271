// The integers of the kitchen as the server sends them, and which cells are floor. The rules are on the server.

/** @typedef {[column: number, row: number]} Cell */
/** @typedef {string[]} Grid one string a row */
/** @typedef {[x: number, y: number, facing: number, held: number]} Player */
/** @typedef {[x: number, y: number, onions: number, cooking: number]} Pot cooking: -1 not yet, COOK_TIME ready */

export const NORTH = 0;
export const SOUTH = 1;
export const EAST = 2;
export const WEST = 3;
export const STAY = 4;
export const INTERACT = 5;
/** A predicted step that is not drawn. */
export const UNSHOWN = 6;
/** @type {Cell[]} by direction: columns, rows */
export const STEP = [
  [0, -1],
  [0, 1],
  [1, 0],
  [-1, 0],
];
export const FACINGS = ['up', 'down', 'right', 'left'];
export const ITEMS = [null, 'onion', 'dish', 'soup'];
export const DISH = 2;
export const SOUP = 3;
/** A pot's time at which its soup is ready. */
export const COOK_TIME = 20;

/**
 * Whether a chef can stand on the cell (digits are the start cells).
 * @param {Grid} grid
 * @param {number} x
 * @param {number} y
 */
export function isFloor(grid, x, y) {
  const tile = grid[y]?.[x];
  return tile === ' ' || tile === '1' || tile === '2';
}

/**
 * Whether a cell is in the view of a chef: at most `radius` columns and rows away.
 * @param {readonly number[]} chef
 * @param {number} x
 * @param {number} y
 * @param {number} radius
 */
export function inView([chefX, chefY], x, y, radius) {
  return Math.max(Math.abs(x - chefX), Math.abs(y - chefY)) <= radius;
}

/**
 * Return the cells of a grid whose tile is `tile`.
 * @param {Grid} grid
 * @param {string} tile
 * @returns {Cell[]}
 */
export function cellsOf(grid, tile) {
  return grid.flatMap((row, y) => [...row].flatMap((each, x) => (each === tile ? [/** @type {Cell} */ ([x, y])] : [])));
}
