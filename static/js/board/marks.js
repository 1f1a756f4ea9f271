// Turns predicted actions into the marks to draw, as plain data.

/** @import { Cell, Grid, Player } from './kitchen.js' */

import { INTERACT, STAY, STEP, UNSHOWN, isFloor } from './kitchen.js';

/**
 * @typedef {object} Mark
 * @property {'move' | 'blunt' | 'hand' | 'ring' | 'none'} kind
 * @property {number} x column of the cell where the mark belongs (for a move: the estimated cell it leaves)
 * @property {number} y
 * @property {number} direction
 * @property {number} dx shift in 1/64 of a cell
 * @property {number} dy
 * @property {boolean} beside whether the chef waits where it stands now
 * @property {number} step 0 is the nearest
 * @property {number} size
 * @property {number} opacity 0..1
 * @property {number} grown size relative to its final one, 0..1, while it grows
 * @property {number} shown 0..1 while it fades in
 * @property {string} id stays the same while the same step comes nearer, so that the mark grows instead of flickering
 */
/** @typedef {{ x: number, y: number, facing: number }} Estimate where the chef will be */

export const SIZES = [1, 0.85, 0.7];
export const FADE_MS = 100;
export const STALE_TICKS = 2;
/** Shift of the rings next to a chef who waits where it stands. */
const BESIDE = [
  [29, -21],
  [31, 5],
  [29, 26],
];
/** Shift of each further mark on the same place. */
const APART = [13, 11];

/**
 * Return the marks of the displayed steps, nearest first. Moves into free cells move the estimate of where the chef
 * will be; the other chef blocks where it is now.
 * @param {[action: number, percent: number][]} displayed action 0-6 and opacity in %, a step each
 * @param {Player} watched
 * @param {Player | undefined} other
 * @param {Grid} grid
 * @returns {Mark[]}
 */
export function marks(displayed, watched, other, grid) {
  const estimate = { x: watched[0], y: watched[1], facing: watched[2] };
  /** @type {Cell} */
  const start = [estimate.x, estimate.y];
  /** @type {Map<string, number>} */
  const taken = new Map();
  return displayed.map(([action, percent], step) => {
    const mark = { ...markOf(action, estimate, start, other, grid, step), step, opacity: percent / 100 };
    mark.size = SIZES[Math.min(step, SIZES.length - 1)];
    const place = `${mark.kind}:${mark.x}:${mark.y}:${mark.direction}`;
    const before = taken.get(place) ?? 0;
    taken.set(place, before + 1);
    mark.id = `${place}:${before}`;
    if (!mark.beside) {
      mark.dx += APART[0] * before;
      mark.dy += APART[1] * before;
    }
    return mark;
  });
}

/**
 * @param {number} action
 * @param {Estimate} estimate is moved on
 * @param {Cell} start
 * @param {Player | undefined} other
 * @param {Grid} grid
 * @param {number} step
 * @returns {Mark}
 */
function markOf(action, estimate, start, other, grid, step) {
  const { x, y, facing } = estimate;
  /** @type {Mark} */
  const mark = {
    ...{ kind: 'none', x, y, direction: facing, dx: 0, dy: 0, beside: false },
    ...{ step, size: 1, opacity: 1, grown: 1, shown: 1, id: '' },
  };
  if (action === UNSHOWN) return mark;
  if (action === STAY) {
    const beside = x === start[0] && y === start[1];
    const [dx, dy] = beside ? BESIDE[step % BESIDE.length] : [0, 0];
    return { ...mark, kind: 'ring', direction: 0, beside, dx, dy };
  }
  if (action === INTERACT) {
    const [columns, rows] = STEP[facing];
    return { ...mark, kind: 'hand', x: x + columns, y: y + rows, direction: 0, dx: 5 * columns, dy: 5 * rows };
  }
  return { ...mark, kind: move(action, estimate, other, grid) ? 'move' : 'blunt', direction: action };
}

/**
 * Move the estimate; return false if something blocks the way, so that the chef only turns.
 * @param {number} direction
 * @param {Estimate} estimate
 * @param {Player | undefined} other
 * @param {Grid} grid
 */
function move(direction, estimate, other, grid) {
  const x = estimate.x + STEP[direction][0];
  const y = estimate.y + STEP[direction][1];
  const free = isFloor(grid, x, y) && !(other && other[0] === x && other[1] === y);
  estimate.facing = direction;
  if (free) Object.assign(estimate, { x, y });
  return free;
}

/**
 * Whether a prediction that arrived at `arrivedMs` is too old to be trusted.
 * @param {number} arrivedMs
 * @param {number} nowMs
 * @param {number} tickMs
 */
export function isStale(arrivedMs, nowMs, tickMs) {
  return nowMs - arrivedMs > STALE_TICKS * tickMs;
}

/**
 * Return the marks on their way from `before` (those of the last tick): new ones fade in, old ones grow to their new
 * size.
 * @param {Mark[]} list
 * @param {Mark[]} before
 * @param {number} ageMs time since the prediction arrived
 * @param {boolean} snap no motion at all
 * @returns {Mark[]}
 */
export function eased(list, before, ageMs, snap) {
  if (snap || ageMs >= FADE_MS) return list;
  const part = Math.max(0, ageMs) / FADE_MS;
  const old = new Map(before.map((mark) => [mark.id, mark]));
  /** @type {(start: number, end: number) => number} */
  const between = (start, end) => start + (end - start) * part;
  return list.map((mark) => {
    const from = old.get(mark.id);
    if (!from) return { ...mark, shown: part };
    const grown = between(from.size / mark.size, 1);
    return { ...mark, grown, dx: between(from.dx, mark.dx), dy: between(from.dy, mark.dy) };
  });
}
