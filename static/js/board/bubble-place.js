// Finds the place for a bubble next to a chef where it hides the least. Units: 1/64 cell.

/** @import { Cell } from './kitchen.js' */
/** @import { StartedState } from './state.js' */

import { badgePlace } from './intention.js';
import { isFloor } from './kitchen.js';
import { isInView } from './state.js';

/** @typedef {{ left: number, top: number, width: number, height: number }} Box */
/** @typedef {Box & { cost: number }} Obstacle cost: of hiding all of it */
/** @typedef {{ lines: string[], width: number, height: number }} Shape */
/** @typedef {{ box: Box, lines: string[] }} Bubble */

const COST = { watched: 60, chef: 40, station: 24, item: 24, badge: 40, mark: 26, tag: 20, way: 3, floor: 0.6 };
const STEP = 8; // between the places that are tried
const FAR = 100; // how far from the chef's middle a bubble's edge may be
const EDGE = 4; // between bubble and board's edge
const DISTANCE = 0.02;
/**
 * A bubble moves only to a place that is better by this much. It is left out if even the best place costs more than
 * LIMIT.
 */
const MOVES_FOR = 2;
const LIMIT = 16;

export class BubblePlacer {
  constructor() {
    this.words = '';
    /** @type {Bubble | null} */
    this.bubble = null;
    /** @type {StartedState['current'] | null} the kitchen that it was placed in */
    this.kitchen = null;
  }

  /**
   * Return the place for a bubble with these words; null where each would hide too much.
   * @param {StartedState} state
   * @param {string} words
   * @param {() => Shape[]} shapes to choose from
   */
  place(state, words, shapes) {
    if (state.current === this.kitchen && words === this.words) return this.bubble;
    const cost = costOf(state);
    const best = bestPlace(state, shapes(), cost);
    const kept = words === this.words ? this.bubble : null;
    const stays = kept && best && isNear(kept.box, chefOf(state)) && cost(kept.box) <= best.cost + MOVES_FOR;
    this.words = words;
    this.kitchen = state.current;
    this.bubble = stays ? kept : best && best.cost <= LIMIT ? best : null;
    return this.bubble;
  }
}

/** @param {StartedState} state @returns {Cell} the middle of the watched chef */
function chefOf({ game, current }) {
  const [x, y] = current.players[game.watched_seat];
  return [x * 64 + 32, y * 64 + 32];
}

/** @type {(box: Box, chef: Cell) => number} from the chef's middle to the box */
function distance({ left, top, width, height }, [x, y]) {
  return Math.hypot(Math.max(left - x, 0, x - left - width), Math.max(top - y, 0, y - top - height));
}

/** @type {(box: Box, chef: Cell) => boolean} */
function isNear(box, chef) {
  return distance(box, chef) <= FAR;
}

/**
 * @param {StartedState} state
 * @param {Shape[]} shapes
 * @param {(box: Box) => number} cost
 * @returns {(Bubble & { cost: number }) | null}
 */
function bestPlace(state, shapes, cost) {
  const { grid } = state.game;
  const [columns, rows] = [grid[0].length * 64, grid.length * 64];
  const chef = chefOf(state);
  /** @type {(Bubble & { cost: number }) | null} */
  let best = null;
  for (const { lines, width, height } of shapes) {
    const lefts = [chef[0] - FAR - width, chef[0] + FAR, columns - width];
    const tops = [chef[1] - FAR - height, chef[1] + FAR, rows - height];
    for (let left = Math.max(EDGE, lefts[0]); left <= Math.min(lefts[1], lefts[2] - EDGE); left += STEP) {
      for (let top = Math.max(EDGE, tops[0]); top <= Math.min(tops[1], tops[2] - EDGE); top += STEP) {
        const box = { left, top, width, height };
        if (!isNear(box, chef)) continue;
        const sum = cost(box);
        if (!best || sum < best.cost) best = { box, lines, cost: sum };
      }
    }
  }
  return best;
}

/**
 * Return how much a box hides and how far from the chef it is.
 * @param {StartedState} state
 * @returns {(box: Box) => number}
 */
function costOf(state) {
  const list = obstacles(state);
  const chef = chefOf(state);
  return (box) => {
    let sum = DISTANCE * distance(box, chef);
    for (const each of list) {
      const across = Math.min(box.left + box.width, each.left + each.width) - Math.max(box.left, each.left);
      const down = Math.min(box.top + box.height, each.top + each.height) - Math.max(box.top, each.top);
      if (across > 0 && down > 0) sum += (each.cost * across * down) / (each.width * each.height);
    }
    return sum;
  };
}

/** @type {(x: number, y: number, side: number, cost: number) => Obstacle} around a middle */
const around = (x, y, side, cost) => ({ left: x - side / 2, top: y - side / 2, width: side, height: side, cost });

/**
 * @param {StartedState} state
 * @returns {Obstacle[]}
 */
function obstacles(state) {
  const { game, current, marks, intention } = state;
  /** @type {Obstacle[]} */
  const list = [];
  game.grid.forEach((row, y) =>
    [...row].forEach((tile, x) => {
      const cost = isFloor(game.grid, x, y) ? COST.floor : tile === 'X' ? 0 : COST.station;
      if (cost) list.push(around(x * 64 + 32, y * 64 + 32, 64, cost));
    }),
  );
  for (const [x, y] of current.counters) list.push(around(x * 64 + 32, y * 64 + 28, 44, COST.item));
  current.players.forEach(([x, y], seat) => {
    if (!isInView(state, seat)) return;
    list.push(around(x * 64 + 32, y * 64 + 30, 74, seat === game.watched_seat ? COST.watched : COST.chef));
    if (seat === game.seat) list.push(around(x * 64 + 32, y * 64 - 12, 34, COST.tag));
  });
  for (const { kind, x, y, dx, dy } of marks) {
    if (kind !== 'none') list.push(around(x * 64 + 32 + dx, y * 64 + 32 + dy, 44, COST.mark));
  }
  for (const [x, y] of intention?.way.slice(1) ?? []) list.push(around(x * 64 + 32, y * 64 + 32, 30, COST.way));
  if (intention) list.push(around(...badgePlace(intention), 36, COST.badge));
  return list;
}
