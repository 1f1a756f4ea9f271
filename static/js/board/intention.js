// Turns a predicted intention into the data to draw: the way to the station, from which side it is
// used, and the words for it.

/** @import { Catalogue } from '../browser/texts.js' */
/** @import { Cell, Grid, Player } from './kitchen.js' */
/** @import { State } from './state.js' */

import { ITEMS, STEP, cellsOf, isFloor } from './kitchen.js';

/** The kind that means that nothing is drawn. */
export const NO_INTENTION = 8;
/** The kinds of interaction by their number; the last one is drawn by nothing. */
const KINDS = ['none', 'take_onion', 'take_dish', 'take_soup', 'fill', 'plate', 'serve', 'put_down', 'none'];
/** @typedef {'take_onion' | 'take_dish' | 'take_soup' | 'fill' | 'plate' | 'serve' | 'put_down'} Kind */
/**
 * @typedef {object} Intention
 * @property {Kind} kind
 * @property {number} x of the station
 * @property {number} y
 * @property {number} opacity 0..1
 * @property {Cell[]} way the floor cells that the chef walks, from where it is to the one next to the station; only the
 *   last one if it cannot get there
 * @property {number} side in which direction the station is from the last cell
 * @property {string | null} item what is taken or given; null: not known
 * @property {boolean} takes whether it comes from the station
 */

/** @type {Record<Kind, string | null>} */
const ITEM_OF = {
  ...{ take_onion: 'onion', take_dish: 'dish', take_soup: 'soup', fill: 'onion', plate: 'soup', serve: 'soup' },
  put_down: null,
};
const TAKEN = ['take_onion', 'take_dish', 'take_soup', 'plate'];
/** @type {Record<string, string>} */
const STATIONS = { P: 'pot', O: 'crate', D: 'rack', S: 'hatch', X: 'counter' };

/** Where the icon is, from the centre of the last floor cell, by direction of the station. */
const PLACES = [
  [20, -38],
  [-20, 38],
  [38, 20],
  [-38, 20],
];

/**
 * Return the data to draw for an intention; null if nothing is drawn.
 * @param {Wire.Tick['intention']} shown
 * @param {Player} watched
 * @param {Player | undefined} other
 * @param {Grid} grid
 * @param {Cell[]} ahead the cells that the drawn steps lead to: the way follows them if they lead to the station
 * @returns {Intention | null}
 */
export function intentionOf([number, x, y, percent], watched, other, grid, ahead = []) {
  const name = KINDS[number];
  if (name === 'none' || name === undefined || grid[y]?.[x] === undefined) return null;
  const kind = /** @type {Kind} */ (name);
  const free = shortestWay(grid, watched, [x, y], other) ?? shortestWay(grid, watched, [x, y], undefined);
  const way = free && alongSteps(free, ahead, grid, [x, y], other);
  const neighbours = STEP.map(([columns, rows]) => /** @type {Cell} */ ([x - columns, y - rows]));
  const last = way?.[way.length - 1] ?? neighbours.find((cell) => isFloor(grid, ...cell)) ?? [x, y];
  const side = STEP.findIndex(([columns, rows]) => last[0] + columns === x && last[1] + rows === y);
  const item = ITEM_OF[kind] ?? ITEMS[watched[3]] ?? null;
  return { kind, x, y, opacity: percent / 100, way: way ?? [last], side, item, takes: TAKEN.includes(kind) };
}

/**
 * Whether two intentions are the same use of the same station.
 * @param {Intention | null} one
 * @param {Intention | null} other
 */
export function isSameIntention(one, other) {
  return one?.kind === other?.kind && one?.x === other?.x && one?.y === other?.y && one?.item === other?.item;
}

/**
 * Return the cells of a shortest way over the floor to a cell next to the station, with the start; null for none.
 * @param {Grid} grid
 * @param {readonly number[]} start
 * @param {Cell} station
 * @param {readonly number[] | undefined} blocked a chef who stands in the way
 * @returns {Cell[] | null}
 */
export function shortestWay(grid, [startX, startY], [x, y], blocked) {
  /** @type {Map<string, Cell | null>} each cell that was reached, and from where */
  const before = new Map([[`${startX},${startY}`, null]]);
  /** @type {Cell[]} */
  const waiting = [[startX, startY]];
  for (let cell = waiting.shift(); cell; cell = waiting.shift()) {
    if (Math.abs(cell[0] - x) + Math.abs(cell[1] - y) === 1) return walkedBack(cell, before);
    for (const [columns, rows] of STEP) {
      /** @type {Cell} */
      const next = [cell[0] + columns, cell[1] + rows];
      const isFree = isFloor(grid, ...next) && !(blocked && blocked[0] === next[0] && blocked[1] === next[1]);
      if (!isFree || before.has(String(next))) continue;
      before.set(String(next), cell);
      waiting.push(next);
    }
  }
  return null;
}

/**
 * Return a way that is as short and begins with as many of the drawn steps as possible.
 * @param {Cell[]} way
 * @param {Cell[]} ahead
 * @param {Grid} grid
 * @param {Cell} station
 * @param {readonly number[] | undefined} other
 * @returns {Cell[]}
 */
function alongSteps(way, ahead, grid, station, other) {
  for (let count = ahead.length; count > 0; count -= 1) {
    const rest = shortestWay(grid, ahead[count - 1], station, other);
    if (rest && count + rest.length === way.length) return [way[0], ...ahead.slice(0, count), ...rest.slice(1)];
  }
  return way;
}

/** @type {(cell: Cell, before: Map<string, Cell | null>) => Cell[]} */
function walkedBack(cell, before) {
  /** @type {Cell[]} */
  const way = [];
  for (let at = /** @type {Cell | null} */ (cell); at; at = before.get(String(at)) ?? null) way.unshift(at);
  return way;
}

/**
 * Return the intention in words, such as "onion to the left pot".
 * @param {Intention} intention
 * @param {Grid} grid
 * @param {Catalogue} text
 */
export function intentionWords({ kind, x, y, item }, grid, text) {
  const place = placeName(grid, x, y, text);
  return text(`intention.${kind}`, { place, item: text(`intention.item.${item ?? 'unknown'}`) });
}

/**
 * Return what the partner is predicted to do next, in words; '' for nothing.
 * @param {State} state
 * @param {Catalogue} text
 */
export function partnersIntention({ intention, game }, text) {
  if (!intention || !game) return '';
  const partner = text(game.partner === 'human' ? 'partner_human' : 'partner');
  return text('say.intention', { partner, words: intentionWords(intention, game.grid, text) });
}

/**
 * Name a station: the pot, the left pot, the upper pot, or pot 3. Counters are not told apart.
 * @param {Grid} grid
 * @param {number} x
 * @param {number} y
 * @param {Catalogue} text
 */
export function placeName(grid, x, y, text) {
  const tile = grid[y][x];
  const name = STATIONS[tile] ?? 'counter';
  const same = usable(grid, tile);
  if (tile === 'X' || same.length < 2) return text(`intention.place.${name}.only`);
  const number = same.findIndex((cell) => cell[0] === x && cell[1] === y) + 1;
  if (same.length > 2) return text(`intention.place.${name}.number`, { number });
  const [[leftX, leftY], [rightX, rightY]] = same;
  const isBeside = Math.abs(rightX - leftX) >= Math.abs(rightY - leftY);
  const word = isBeside ? ['left', 'right'][number - 1] : y === Math.min(leftY, rightY) ? 'upper' : 'lower';
  return text(`intention.place.${name}.${word}`);
}

/**
 * Return the stations of a kind that a chef can use, from left to right.
 * @param {Grid} grid
 * @param {string} tile
 */
function usable(grid, tile) {
  const isUsable = (/** @type {Cell} */ cell) => STEP.some(([dx, dy]) => isFloor(grid, cell[0] + dx, cell[1] + dy));
  return cellsOf(grid, tile)
    .filter(isUsable)
    .sort(([a, b], [c, d]) => a - c || b - d);
}

/**
 * Return the stations that the words tell apart by a number: those of which there are more than two.
 * @param {Grid} grid
 * @returns {{ x: number, y: number, number: number }[]}
 */
export function numberedStations(grid) {
  const kinds = ['P', 'O', 'D', 'S'].map((tile) => usable(grid, tile)).filter((cells) => cells.length > 2);
  return kinds.flatMap((cells) => cells.map(([x, y], index) => ({ x, y, number: index + 1 })));
}

/**
 * Return the middle of the icon in 1/64 cell.
 * @param {Intention} intention
 * @returns {Cell}
 */
export function badgePlace({ way, side }) {
  const [x, y] = way[way.length - 1];
  const [dx, dy] = PLACES[side] ?? [0, 0];
  return [x * 64 + 32 + dx, y * 64 + 32 + dy];
}
