// Lets the points of a served soup fly from the hatch to the score, around the board so that they hide none of it.

/** @import { BoardEvent } from '../board/events.js' */
/** @import { Grid } from '../board/kitchen.js' */
/** @import { State } from '../board/state.js' */

import { isStarted } from '../board/state.js';
import { find } from '../browser/dom.js';

/** @typedef {[x: number, y: number]} Point in CSS pixels of the window */
/** @typedef {{ left: number, top: number, right: number, bottom: number }} Box */

const FLIGHT_MS = 900;
const MARGIN = 16; // half the height of the points

/**
 * Return the corners of the flight: out of the board at the hatch's nearest edge, up along it, to the score.
 * @param {{ x: number, y: number }} hatch a cell
 * @param {Grid} grid
 * @param {Box} board
 * @param {Point} score
 * @returns {Point[]}
 */
export function flight({ x, y }, grid, board, score) {
  const columns = grid[0].length;
  const cell = (board.right - board.left) / columns;
  const [middleX, middleY] = [board.left + (x + 0.5) * cell, board.top + (y + 0.5) * cell];
  const isRight = x >= columns / 2;
  const outer = isRight ? board.right + MARGIN : board.left - MARGIN;
  const above = board.top - MARGIN;
  const down = grid.length - 1 - y;
  const across = isRight ? columns - 1 - x : x;
  if (y <= Math.min(across, down)) return [[middleX, above], score];
  /** @type {Point[]} */
  const way = [[outer, middleY], [outer, above], score];
  return down < across ? [[middleX, board.bottom + MARGIN], [outer, board.bottom + MARGIN], ...way.slice(1)] : way;
}

/**
 * Show the points of one soup on their flight.
 * @param {HTMLElement} page
 * @param {Point[]} way
 * @param {number} points
 */
function fly(page, way, points) {
  const label = document.createElement('span');
  label.className = 'points';
  label.textContent = `+${points}`;
  label.setAttribute('aria-hidden', 'true');
  page.append(label);
  const frames = way.map(([x, y], k) => ({
    transform: `translate(${x}px, ${y}px) translate(-50%, -50%) scale(${k === way.length - 1 ? 0.6 : 1})`,
    opacity: k === way.length - 1 ? 0.4 : 1,
  }));
  const animation = label.animate(frames, { duration: FLIGHT_MS, easing: 'ease-in-out' });
  animation.onfinish = animation.oncancel = () => label.remove();
}

/**
 * Let the points of the soups that were just served fly from their hatches to the score.
 * @param {HTMLElement} page
 * @param {HTMLCanvasElement} canvas
 * @param {State} state
 * @param {BoardEvent[]} happened in the last timestep
 */
export function flyDeliveries(page, canvas, state, happened) {
  if (!isStarted(state) || typeof page.animate !== 'function') return;
  const hatches = happened.filter(({ kind }) => kind === 'delivery');
  const points = state.current.score - (state.previous?.score ?? 0);
  if (!hatches.length || points <= 0) return;
  const { left, top, width, height } = find('#score', HTMLElement, page).getBoundingClientRect();
  const board = canvas.getBoundingClientRect();
  for (const hatch of hatches) {
    const way = flight(hatch, state.game.grid, board, [left + width / 2, top + height / 2]);
    fly(page, way, Math.round(points / hatches.length));
  }
}
