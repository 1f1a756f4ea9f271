// A slow-motion example of what the marks mean: a chef whose next steps are shown, and who then takes them.

/** @import { Player, Pot } from './kitchen.js' */
/** @import { State } from './state.js' */

import { NO_INTENTION } from './intention.js';
import { EAST, INTERACT, NORTH, STAY, STEP, WEST } from './kitchen.js';
import { apply } from './state.js';
import { boardState, tickOf } from './still-board.js';

export const GRID = ['XXPXXXX', 'X     D', 'O     X', 'X     S', 'XXXXXXX'];
/** The watched chef's actions, with every kind of mark: walk, turn, use, wait. */
export const ACTIONS = [NORTH, WEST, WEST, NORTH, INTERACT, STAY];
const OPACITIES = [95, 80, 60];
const TICK_MS = 200;
const ONION = 1;
/** @type {Wire.Tick['intention']} it fills the pot */
const FILLS_POT = [4, 2, 0, 95];
/** @type {Wire.Tick['intention']} */
const NOTHING = [NO_INTENTION, -1, -1, 95];
/** @type {Player} */
const OWN = [1, 3, EAST, 0];

/**
 * Return the kitchen after the first `done` actions.
 * @param {number} done
 * @returns {Wire.KitchenState}
 */
function kitchenAfter(done) {
  let [x, y] = [4, 2];
  let facing = WEST;
  const actions = ACTIONS.slice(0, done);
  for (const action of actions.filter((each) => each < STAY)) {
    facing = action;
    const [columns, rows] = STEP[action];
    if (y + rows > 0) [x, y] = [x + columns, y + rows]; // the pot's row is not floor
  }
  const isIn = actions.includes(INTERACT);
  /** @type {Pot} */
  const pot = [2, 0, isIn ? 3 : 2, isIn ? Math.max(0, done - ACTIONS.indexOf(INTERACT) - 1) : -1];
  return { t: done, players: [OWN, [x, y, facing, isIn ? 0 : ONION]], counters: [], pots: [pot], score: 0, soups: 0 };
}

/**
 * Return the example before the chef's first action, or the state in which it is after one more action than `before`.
 * @param {State | null} before
 * @param {{ steps: number, display: Wire.Welcome['display'] }} shown how many next steps; what of them is shown
 * @param {number} now in ms
 * @returns {State}
 */
export function nextMoment(before, { steps, display }, now) {
  const done = before?.current ? before.current.t + 1 : 0;
  const state = kitchenAfter(done);
  const still = { grid: GRID, seat: 0, watched_seat: 1, tick_ms: TICK_MS, horizon: 0 };
  const start = before?.current ? before : boardState(still, { ...state, t: -1 }, now);
  const opacities = display === 'intention' ? [] : OPACITIES.slice(0, steps);
  /** @type {[number, number][]} */
  const prediction = opacities.map((opacity, k) => [ACTIONS[done + k] ?? STAY, opacity]);
  const intention = display !== 'actions' && done <= ACTIONS.indexOf(INTERACT) ? FILLS_POT : NOTHING;
  return apply(start, tickOf({ state, prediction, intention, actions: [STAY, ACTIONS[done - 1] ?? STAY] }), now);
}
