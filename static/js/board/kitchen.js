// The integers of the kitchen, as the server sends them, and what the browser may know of a grid: which cells are floor.
// No rules live here: the server plays, the browser draws.

export const NORTH = 0, SOUTH = 1, EAST = 2, WEST = 3, STAY = 4, INTERACT = 5;
export const UNSHOWN = 6; // a predicted step that is not drawn
export const STEP = [[0, -1], [0, 1], [1, 0], [-1, 0]]; // by direction: columns, rows
export const FACINGS = ['up', 'down', 'right', 'left'];
export const ITEMS = [null, 'onion', 'dish', 'soup'];
export const SOUP = 3;
export const COOK_TIME = 20; // a pot's tick at which its soup is ready

/** Whether a chef can stand on the cell (digits are the start cells). */
export function isFloor(grid, x, y) {
  const tile = grid[y]?.[x];
  return tile === ' ' || tile === '1' || tile === '2';
}

/** Cells [x, y] of a grid whose tile is `tile`. */
export function cellsOf(grid, tile) {
  const cells = [];
  grid.forEach((row, y) => [...row].forEach((each, x) => { if (each === tile) cells.push([x, y]); }));
  return cells;
}
