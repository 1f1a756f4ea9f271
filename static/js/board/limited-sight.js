// Limited sight on the board: a veil over what is out of view, and the view's edge.

/** @import { StartedState } from './state.js' */

import { CELL } from './background.js';
import { inView } from './kitchen.js';
import { colour } from './sprites.js';

const REMEMBERED = 'rgb(34 48 60 / 36%)'; // shown as last seen
const UNKNOWN = 'rgb(34 48 60 / 72%)'; // what is there was never seen
const EDGE = 3;

/**
 * Cover the cells out of view: those whose contents were never seen more than those that are remembered.
 * @param {CanvasRenderingContext2D} context
 * @param {StartedState} state
 */
export function drawVeil(context, { game, current, unknown }) {
  if (!game.view_radius || game.seat < 0) return;
  const own = current.players[game.seat];
  const never = new Set(unknown.map(([x, y]) => `${x},${y}`));
  game.grid.forEach((row, y) =>
    [...row].forEach((_, x) => {
      if (inView(own, x, y, game.view_radius)) return;
      context.fillStyle = never.has(`${x},${y}`) ? UNKNOWN : REMEMBERED;
      context.fillRect(x * CELL, y * CELL, CELL, CELL);
    }),
  );
}

/**
 * Draw with everything cut off at the edge of the view.
 * @param {CanvasRenderingContext2D} context
 * @param {StartedState} state
 * @param {() => void} draw
 */
export function withinView(context, state, draw) {
  const box = viewBox(state);
  context.save();
  if (box) {
    context.beginPath();
    context.rect(...box);
    context.clip();
  }
  draw();
  context.restore();
}

/**
 * Outline the view, for researchers.
 * @param {CanvasRenderingContext2D} context
 * @param {StartedState} state
 */
export function outlineView(context, state) {
  const box = viewBox(state);
  if (!box) return;
  context.save();
  context.strokeStyle = colour('--human');
  context.lineWidth = EDGE;
  context.setLineDash([9, 6]);
  context.strokeRect(...box);
  context.restore();
}

/**
 * Return the view in drawing units: left, top, width, height; null for a whole kitchen.
 * @param {StartedState} state
 * @returns {[number, number, number, number] | null}
 */
function viewBox({ game, current }) {
  if (!game.view_radius || game.seat < 0) return null;
  const [x, y] = current.players[game.seat];
  const radius = game.view_radius;
  const [left, top] = [Math.max(0, x - radius), Math.max(0, y - radius)];
  const right = Math.min(game.grid[0].length - 1, x + radius);
  const bottom = Math.min(game.grid.length - 1, y + radius);
  return [left * CELL, top * CELL, (right - left + 1) * CELL, (bottom - top + 1) * CELL];
}
