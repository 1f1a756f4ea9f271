// Predicted actions -> marks to draw, as plain data. Knows no canvas and no page.
//
// A mark: {kind: 'move' | 'blunt' | 'hand' | 'ring' | 'none', x, y, direction, step, size, opacity, dx, dy, grown, shown, id}. (x, y) is the
// cell where the mark belongs (for a move: the estimated cell it leaves), (dx, dy) a shift in 1/64 of a cell. `id` stays
// the same while the same step comes nearer, so that it grows instead of flickering; `grown` and `shown` say how far it is.

import { INTERACT, STAY, STEP, UNSHOWN, isFloor } from './kitchen.js';

export const SIZES = [1, 0.85, 0.7];
export const FADE_MS = 100;
export const STALE_TICKS = 2;
const BESIDE = [[29, -21], [31, 5], [29, 26]]; // rings next to a chef who waits where it stands
const APART = [13, 11]; // each further mark on the same spot

/** The marks of a prediction, nearest step first. `watched` and `other` are players [x, y, facing, held]; `prediction` is
 * [[action 0-6, opacity in %], ...]. Moves into free cells carry the estimate on; the other chef blocks where it is now. */
export function marks(prediction, watched, other, grid) {
  const here = { x: watched[0], y: watched[1], facing: watched[2] };
  const start = [here.x, here.y];
  const taken = new Map();
  return prediction.map(([action, percent], step) => {
    const mark = oneMark(action, here, start, other, grid, step);
    mark.step = step;
    mark.size = SIZES[Math.min(step, SIZES.length - 1)];
    mark.opacity = percent / 100;
    mark.grown = mark.shown = 1;
    const spot = `${mark.kind}:${mark.x}:${mark.y}:${mark.direction}`;
    const before = taken.get(spot) ?? 0;
    taken.set(spot, before + 1);
    mark.id = `${spot}:${before}`;
    if (!mark.beside) { mark.dx += APART[0] * before; mark.dy += APART[1] * before; }
    return mark;
  });
}

function oneMark(action, here, start, other, grid, step) {
  const mark = { kind: 'none', x: here.x, y: here.y, direction: here.facing, dx: 0, dy: 0, beside: false };
  if (action === UNSHOWN) return mark;
  if (action === STAY) {
    mark.kind = 'ring';
    mark.direction = 0;
    mark.beside = here.x === start[0] && here.y === start[1];
    if (mark.beside) [mark.dx, mark.dy] = BESIDE[step % BESIDE.length];
  } else if (action === INTERACT) {
    const [columns, rows] = STEP[here.facing];
    Object.assign(mark, { kind: 'hand', x: here.x + columns, y: here.y + rows, direction: 0, dx: 5 * columns, dy: 5 * rows });
  } else {
    walk(mark, action, here, other, grid);
  }
  return mark;
}

function walk(mark, direction, here, other, grid) {
  const x = here.x + STEP[direction][0], y = here.y + STEP[direction][1];
  const free = isFloor(grid, x, y) && !(other && other[0] === x && other[1] === y);
  mark.kind = free ? 'move' : 'blunt';
  mark.direction = here.facing = direction;
  if (free) { here.x = x; here.y = y; }
}

/** Whether a prediction that arrived at `arrivedMs` is too old to be trusted. */
export function isStale(arrivedMs, nowMs, tickMs) {
  return nowMs - arrivedMs > STALE_TICKS * tickMs;
}

/** The marks on their way from `before` (those of the tick before): new ones fade in, ones that were there already grow to
 * their new size. `ageMs`: time since the prediction came; `snap`: no motion at all. */
export function eased(list, before, ageMs, snap) {
  if (snap || ageMs >= FADE_MS) return list;
  const part = Math.max(0, ageMs) / FADE_MS;
  const old = new Map(before.map((mark) => [mark.id, mark]));
  return list.map((mark) => {
    const from = old.get(mark.id);
    if (!from) return { ...mark, shown: part };
    const between = (start, end) => start + (end - start) * part;
    return { ...mark, grown: between(from.size / mark.size, 1), dx: between(from.dx, mark.dx), dy: between(from.dy, mark.dy) };
  });
}
