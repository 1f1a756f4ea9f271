// Finds what happened between two kitchens, for effects, sounds and announcements.

/** @import { Grid, Pot } from './kitchen.js' */

/** @import { StartedState } from './state.js' */

import { COOK_TIME, SOUP, STEP, inView } from './kitchen.js';

/**
 * @typedef {object} BoardEvent
 * @property {'delivery' | 'ready' | 'potted' | 'started' | 'taken' | 'put' | 'bump'} kind
 * @property {number} x column of the cell where it shows
 * @property {number} y
 * @property {number} [seat] whose chef did it
 * @property {number} [item]
 */

/**
 * Return what happened; nothing if `after` is not newer.
 * @param {Wire.KitchenState | null} before
 * @param {Wire.KitchenState} after
 * @param {number[]} actions what the chefs did in between
 * @param {Grid} grid
 * @returns {BoardEvent[]}
 */
export function events(before, after, actions, grid) {
  if (!before || after.t <= before.t) return [];
  return [...hands(before, after, grid), ...pots(before, after), ...bumps(before, after, actions)];
}

/**
 * Return the events that a participant with limited sight has seen: a change that only comes into view happened
 * earlier.
 * @param {BoardEvent[]} list
 * @param {StartedState} state
 */
export function witnessed(list, { game, previous, current, partnerSeen, partnerSeenBefore }) {
  if (!game.view_radius || game.seat < 0 || !previous) return list;
  const views = [previous, current].map(({ players }) => players[game.seat]);
  return list.filter(({ seat, x, y }) => {
    if (seat !== undefined) return seat === game.seat || (partnerSeen && partnerSeenBefore);
    return views.every((own) => inView(own, x, y, game.view_radius));
  });
}

/**
 * @param {Wire.KitchenState} before
 * @param {Wire.KitchenState} after
 * @param {Grid} grid
 * @returns {BoardEvent[]}
 */
function hands(before, after, grid) {
  return after.players.flatMap(([x, y, facing, held], seat) => {
    const had = before.players[seat][3];
    if (had === held) return [];
    const cell = { x: x + STEP[facing][0], y: y + STEP[facing][1], seat, item: held || had };
    return [{ kind: handEvent(had, held, grid[cell.y]?.[cell.x]), ...cell }];
  });
}

/**
 * @param {number} had
 * @param {number} held
 * @param {string | undefined} tile the tile that the chef faces
 * @returns {BoardEvent['kind']}
 */
function handEvent(had, held, tile) {
  if (had === SOUP && held === 0 && tile === 'S') return 'delivery';
  if (held !== 0) return 'taken';
  return tile === 'P' ? 'potted' : 'put';
}

/**
 * @param {Wire.KitchenState} before
 * @param {Wire.KitchenState} after
 * @returns {BoardEvent[]}
 */
function pots(before, after) {
  const old = new Map(before.pots.map(([x, y, , cooking]) => [`${x},${y}`, cooking]));
  /** @type {(pot: Pot) => BoardEvent[]} */
  const eventsOf = ([x, y, , cooking]) => {
    const was = old.get(`${x},${y}`) ?? -1;
    if (cooking >= COOK_TIME && was < COOK_TIME) return [{ kind: 'ready', x, y }];
    return cooking >= 0 && was < 0 ? [{ kind: 'started', x, y }] : [];
  };
  return after.pots.flatMap((pot) => eventsOf(pot));
}

/**
 * @param {Wire.KitchenState} before
 * @param {Wire.KitchenState} after
 * @param {number[]} actions
 * @returns {BoardEvent[]}
 */
function bumps(before, after, actions) {
  return after.players.flatMap(([x, y], seat) => {
    const [oldX, oldY] = before.players[seat];
    return actions[seat] < 4 && x === oldX && y === oldY ? [{ kind: 'bump', x, y, seat }] : [];
  });
}
