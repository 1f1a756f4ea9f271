// Turns predicted actions into the marks to draw, as plain data.

/** @import { Cell, Grid, Player } from './kitchen.js' */

import { INTERACT, STAY, STEP, UNSHOWN, isFloor } from './kitchen.js';

/**
 * @typedef {object} Mark
 * @property {'move' | 'blunt' | 'hand' | 'ring' | 'none'} kind
 * @property {number} x column of the cell where the mark belongs (for a move: the estimated cell it leaves)
 * @property {number} y
 * @property {number} direction
 * @property {number} dx shift from that cell's centre in 1/64 of a cell
 * @property {number} dy
 * @property {Cell[]} points of a move: the corners of its arrow, from tail to tip, in cells
 * @property {boolean} attached whether it begins at the chef: it then follows the chef on screen
 * @property {number} count how many steps in a row it stands for
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
/** Where a hand is, from the centre of the chef's cell, by direction: on the edge to the station, next to the chef. */
const HANDS = [
  [-19, -20],
  [20, 20],
  [23, -18],
  [-23, -18],
];
/** Where a ring is: the upper corner that the hand leaves free. */
const RINGS = [
  [22, -20],
  [22, -20],
  [-22, -20],
  [22, -20],
];
/** How far an arrow's tip is past the centre of the cell it leads to, and how far it stays away from the chef. */
const TIP = 8 / 64;
const TIP_AT_CHEF = 23 / 64;
/** Shifts of the arrows between the same two cells, to the right of the first one, by their number. */
const LANES = [[0], [0], [12, -12], [17, 0, -17]];

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
  const list = displayed.map(([action, percent], step) => {
    const size = SIZES[Math.min(step, SIZES.length - 1)];
    return { ...markOf(action, estimate, watched, other, grid), step, size, opacity: percent / 100 };
  });
  layPath(list, watched);
  return nameAndMerge(list);
}

/**
 * @param {number} action
 * @param {Estimate} estimate is moved on
 * @param {Player} watched
 * @param {Player | undefined} other
 * @param {Grid} grid
 * @returns {Mark}
 */
function markOf(action, estimate, watched, other, grid) {
  const { x, y, facing } = estimate;
  /** @type {Mark} */
  const mark = {
    ...{ kind: 'none', x, y, direction: facing, dx: 0, dy: 0, points: [[x, y]], count: 1 },
    ...{ attached: x === watched[0] && y === watched[1], step: 0, size: 1, opacity: 1, grown: 1, shown: 1, id: '' },
  };
  if (action === UNSHOWN) return mark;
  if (action === STAY) {
    const [dx, dy] = RINGS[facing];
    return { ...mark, kind: 'ring', direction: 0, dx, dy };
  }
  if (action === INTERACT) {
    const [columns, rows] = STEP[facing];
    const [dx, dy] = HANDS[facing];
    return { ...mark, kind: 'hand', x: x + columns, y: y + rows, dx: dx - 64 * columns, dy: dy - 64 * rows };
  }
  return { ...mark, kind: move(action, estimate, other, grid) ? 'move' : 'blunt', direction: action };
}

/**
 * Join the moves to one path that starts at the chef. Arrows between the same two cells lie next to each other.
 * @param {Mark[]} list
 * @param {Player} watched
 */
function layPath(list, [startX, startY]) {
  const moves = list.filter((mark) => mark.kind === 'move');
  /** @type {Cell | null} */
  let end = null;
  for (const mark of moves) {
    const [columns, rows] = STEP[mark.direction];
    const [shiftX, shiftY] = laneOf(mark, moves);
    const [toX, toY] = [mark.x + columns, mark.y + rows];
    const past = toX === startX && toY === startY ? -TIP_AT_CHEF : TIP;
    mark.attached = end === null;
    mark.points = [[mark.x + shiftX, mark.y + shiftY]];
    if (end) mark.points.unshift(end);
    mark.points.push([toX + shiftX + past * columns, toY + shiftY + past * rows]);
    end = [toX + shiftX, toY + shiftY];
  }
}

/**
 * Return the shift of a move, in cells, among all moves between the same two cells.
 * @param {Mark} mark
 * @param {Mark[]} moves
 * @returns {Cell}
 */
function laneOf(mark, moves) {
  const same = moves.filter((other) => borderOf(other) === borderOf(mark));
  const lane = LANES[Math.min(same.length, 3)][same.indexOf(mark)] ?? 0;
  const [columns, rows] = STEP[same[0].direction];
  return [(-rows * lane) / 64 || 0, (columns * lane) / 64 || 0];
}

/**
 * Return the cell that a move leads to.
 * @param {Mark} mark
 * @returns {Cell}
 */
export function cellAfter({ x, y, direction }) {
  return [x + STEP[direction][0], y + STEP[direction][1]];
}

/** @param {Mark} mark */
function borderOf({ x, y, direction }) {
  return `${x + STEP[direction][0] / 2}:${y + STEP[direction][1] / 2}`;
}

/**
 * Name the marks and count the same ones in one mark: a second hand would only hide more of the kitchen.
 * The repeats become invisible marks, so that every prediction is the same work for the browser.
 * @param {Mark[]} list
 * @returns {Mark[]}
 */
function nameAndMerge(list) {
  /** @type {Map<string, Mark>} */
  const first = new Map();
  /** @type {Map<string, number>} */
  const taken = new Map();
  return list.map((mark) => {
    const place = `${mark.kind}:${mark.x}:${mark.y}:${mark.direction}`;
    const before = taken.get(place) ?? 0;
    taken.set(place, before + 1);
    const named = { ...mark, id: `${place}:${before}` };
    const same = first.get(place);
    if (!same || mark.kind === 'move' || mark.kind === 'none') {
      first.set(place, named);
      return named;
    }
    same.count += 1;
    return { ...named, kind: /** @type {const} */ ('none') };
  });
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
