// Draws one frame of the state: board, pots, items, marks, chefs, effects. It never changes the state.

/** @import { Chef, Motion } from './chef.js' */
/** @import { Style } from './draw-marks.js' */
/** @import { Catalogue } from '../browser/texts.js' */
/** @import { IntentionStyle } from './draw-intention.js' */
/** @import { Cell, Grid, Pot } from './kitchen.js' */
/** @import { Mark } from './marks.js' */
/** @import { Sprites } from './sprites.js' */
/** @import { StartedState, State } from './state.js' */

import { context2d } from '../browser/dom.js';
import { BubblePlacer } from './bubble-place.js';
import { CELL, contactShadow, paintBackground } from './background.js';
import { drawChef, drawTag } from './chef.js';
import { drawArrow } from './draw-arrows.js';
import { drawHighlight } from './draw-highlight.js';
import { bubbleShapes, drawBadge, drawBubble, drawStationNumbers, drawWay } from './draw-intention.js';
import { drawIcon } from './draw-marks.js';
import { drawCookingRing, potSprite } from './draw-pots.js';
import { Effects, drawPotEffects } from './effects.js';
import { events, witnessed } from './events.js';
import { intentionWords } from './intention.js';
import { COOK_TIME, ITEMS, inView } from './kitchen.js';
import { FADE_MS, eased, isStale } from './marks.js';
import { facing, isInView, isStarted, place, progress } from './state.js';
import { drawVeil, outlineView, withinView } from './limited-sight.js';

/** Device pixels per CSS pixel at most: more are not visible, and each costs time in every frame. */
const MAX_RATIO = 2;
const LANDING_MS = 160; // how long an item that was put down comes to rest
const BUBBLE_PX = 12; // CSS pixels: the smallest letters of the bubble next to a chef
const BUBBLE_LETTERS = 9.5; // 1/64 cell: the same on large boards

export class Renderer {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Sprites} sprites
   * @param {string} youText the tag over the own chef; '' for none
   */
  constructor(canvas, sprites, youText) {
    this.canvas = canvas;
    this.sprites = sprites;
    this.youText = youText;
    this.context = context2d(canvas, { alpha: false }); // opaque: nothing below it is painted again
    this.effects = new Effects();
    this.cellPixels = 0;
    this.tagScale = 1;
    this.ratio = 1;
    /** @type {HTMLCanvasElement | null} */
    this.background = null;
    /** @type {Grid} */
    this.grid = [];
    /** @type {Cell | null} the cell that the tutorial points at */
    this.highlight = null;
    /** Whether marks turn grey without a newer prediction; off in a replay, which does not wait for any. */
    this.greysOldMarks = true;
    /** Whether a limited view is only outlined: researchers see the whole kitchen. */
    this.outlinesView = false;
    /** @type {Catalogue | null} the words of the bubble next to a chef; null: none is drawn */
    this.text = null;
    this.bubblePlacer = new BubblePlacer();
    /** @type {Map<string, number>} "x,y" -> when an item was put there */
    this.landed = new Map();
  }

  /**
   * Fit the canvas into width x height CSS pixels, with a whole number of device pixels a cell.
   * @param {Grid} grid
   * @param {number} width
   * @param {number} height
   * @returns {number} the size of a cell in CSS pixels
   */
  fit(grid, width, height) {
    const ratio = pixelRatio();
    const columns = grid[0].length;
    const rows = grid.length;
    const cell = Math.max(8, Math.floor(Math.min(width / columns, height / rows) * ratio));
    if (cell !== this.cellPixels || grid !== this.grid) {
      this.sprites.resized();
      this.cellPixels = cell;
      this.grid = grid;
      this.background = paintBackground(grid, this.sprites, cell);
      this.canvas.width = columns * cell;
      this.canvas.height = rows * cell;
      this.canvas.dataset.columns = String(columns);
      this.canvas.style.width = `${(columns * cell) / ratio}px`;
      this.canvas.style.height = `${(rows * cell) / ratio}px`;
      this.ratio = ratio;
      this.bubblePlacer = new BubblePlacer();
      this.tagScale = Math.min(1.5, Math.max(1, 52 / (cell / ratio)));
    }
    return cell / ratio;
  }

  /**
   * Start the effects of what happened between the last two kitchens; return what happened.
   * @param {State} state
   * @param {number} now
   */
  applyEvents(state, now) {
    if (!isStarted(state)) return [];
    const all = events(state.previous, state.current, state.actions, state.game.grid);
    const list = this.outlinesView ? all : witnessed(all, state);
    this.effects.add(list, now, state.current.t);
    for (const { kind, x, y } of list) if (kind === 'put') this.landed.set(`${x},${y}`, now);
    return list;
  }

  /** Forget earlier events, because another moment of the game is shown. */
  forgetEffects() {
    this.effects.shown = [];
    this.landed.clear();
  }

  /**
   * Draw the state as it is at `now`.
   * @param {State} state
   * @param {number} now
   * @param {boolean} reduced less motion
   */
  draw(state, now, reduced) {
    if (!this.background || !isStarted(state)) return;
    const context = this.context;
    const scale = this.cellPixels / CELL;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.globalAlpha = 1;
    context.drawImage(this.background, 0, 0);
    context.setTransform(scale, 0, 0, scale, 0, 0);
    this.#drawPots(state, now, reduced);
    this.#drawItems(state, now, reduced);
    if (state.saysIntention) drawStationNumbers(context, this.grid, this.tagScale);
    if (!this.outlinesView) drawVeil(context, state);
    const marks = this.#marks(state, now, reduced);
    const style = this.#markStyle(state, now, reduced);
    this.#drawOnFloor(state, marks, style, now, reduced);
    if (this.highlight) drawHighlight(context, this.highlight, now, reduced);
    this.#drawChefs(state, now, reduced);
    for (const mark of marks) drawIcon(context, mark, style);
    this.#drawBubble(state, style, now, reduced);
    if (this.outlinesView) outlineView(context, state);
    this.#drawTag(state, now, reduced);
    this.effects.draw(context, now, state.current.t, reduced, this.grid[0].length);
  }

  /** @type {(name: string, x: number, y: number, side: number) => void} */
  #put(name, x, y, side) {
    this.context.drawImage(this.sprites.at(name, (side * this.cellPixels) / CELL), x, y, side, side);
  }

  /** @type {(state: StartedState, now: number, reduced: boolean) => void} */
  #drawPots(state, now, reduced) {
    const full = new Map(state.current.pots.map((pot) => [`${pot[0]},${pot[1]}`, pot]));
    this.grid.forEach((row, y) =>
      [...row].forEach((tile, x) => {
        if (tile === 'P') this.#drawPot(full.get(`${x},${y}`) ?? [x, y, 0, -1], state, now, reduced);
      }),
    );
  }

  /** @type {(pot: Pot, state: StartedState, now: number, reduced: boolean) => void} */
  #drawPot(pot, state, now, reduced) {
    const [x, y, , cooking] = pot;
    contactShadow(this.context, x * CELL + 32, y * CELL + 57, 25);
    this.#put(potSprite(pot), x * CELL + 2, y * CELL + 1, CELL - 4);
    if (cooking < 0) return;
    const alive = !reduced && state.phase === 'playing' && state.link === 'open';
    if (alive) drawPotEffects(this.context, pot, now);
    if (cooking < COOK_TIME) {
      const glide = alive ? Math.min(1, (now - state.arrivedMs) / state.game.tick_ms) : 0;
      drawCookingRing(this.context, x, y, Math.min(1, (cooking + glide) / COOK_TIME));
    }
  }

  /** @type {(state: StartedState, now: number, reduced: boolean) => void} */
  #drawItems(state, now, reduced) {
    for (const [x, y, item] of state.current.counters) {
      const age = now - (this.landed.get(`${x},${y}`) ?? -1e9);
      const lift = reduced || age > LANDING_MS ? 0 : 1 - age / LANDING_MS;
      const side = 40 * (1 + 0.22 * lift);
      contactShadow(this.context, x * CELL + 32, y * CELL + 43, 15);
      this.#put(`item-${ITEMS[item]}`, x * CELL + 32 - side / 2, y * CELL + 25 - side / 2 - 10 * lift, side);
    }
  }

  /**
   * Return the marks in the order in which they are drawn: the nearest last, on top of the others.
   * @type {(state: StartedState, now: number, reduced: boolean) => Mark[]}
   */
  #marks(state, now, reduced) {
    return [...eased(state.marks, state.marksBefore, now - state.arrivedMs, reduced)].reverse();
  }

  /** @type {(state: StartedState, now: number, reduced: boolean) => Style} */
  #markStyle(state, now, reduced) {
    const { watched_seat: watched, seat, tick_ms: tickMs } = state.game;
    const isOld = this.greysOldMarks && isStale(state.arrivedMs, now, tickMs);
    const [x, y] = state.current.players[watched];
    return {
      sprites: this.sprites,
      who: isOld ? 'stale' : watched === seat ? 'human' : 'partner',
      scale: this.cellPixels / CELL,
      chef: reduced ? [x, y] : place(state, watched, now),
      cell: [x, y],
    };
  }

  /** @type {(state: StartedState, marks: Mark[], style: Style, now: number, reduced: boolean) => void} */
  #drawOnFloor(state, marks, style, now, reduced) {
    const { context } = this;
    const { intention, game } = state;
    const own = state.current.players[game.seat];
    const ofIntention = this.#intentionStyle(state, style, now, reduced);
    withinView(context, state, () => {
      if (intention) drawWay(context, intention, ofIntention);
      for (const mark of marks) drawArrow(context, mark, style);
    });
    const isSeen = intention && (!game.view_radius || !own || inView(own, intention.x, intention.y, game.view_radius));
    if (isSeen) drawBadge(context, intention, ofIntention);
  }

  /** @type {(state: StartedState, style: Style, now: number, reduced: boolean) => void} */
  #drawBubble(state, style, now, reduced) {
    const { context, text } = this;
    const { intention } = state;
    if (!intention || !text) return;
    const size = Math.max(BUBBLE_LETTERS, (BUBBLE_PX * CELL * this.ratio) / this.cellPixels);
    const words = intentionWords(intention, this.grid, text);
    const bubble = this.bubblePlacer.place(state, words, () => bubbleShapes(context, words, size));
    const ofIntention = this.#intentionStyle(state, style, now, reduced);
    if (bubble) drawBubble(context, { ...bubble, size }, intention.opacity, ofIntention);
  }

  /** @type {(state: StartedState, style: Style, now: number, reduced: boolean) => IntentionStyle} */
  #intentionStyle(state, style, now, reduced) {
    const shown = reduced ? 1 : Math.min(1, Math.max(0, (now - state.intentionMs) / FADE_MS));
    return { ...style, shown, size: this.tagScale };
  }

  /** @type {(state: StartedState, now: number, reduced: boolean) => void} */
  #drawChefs(state, now, reduced) {
    const chefs = state.current.players
      .flatMap((_, seat) => (isInView(state, seat) ? [this.#chef(state, seat, now, reduced)] : []))
      .sort((a, b) => a.y - b.y); // the one in front is drawn last; equal ones stay in the order of seats
    for (const chef of chefs) drawChef(this.context, this.sprites, chef);
  }

  /** @type {(state: StartedState, now: number, reduced: boolean) => void} */
  #drawTag(state, now, reduced) {
    const { seat } = state.game;
    if (seat < 0 || !this.youText) return;
    const [x, y] = state.current.players[seat];
    /** @type {(row: number) => boolean} */
    const isUsed = (row) =>
      'PODS'.includes(this.grid[row]?.[x] ?? 'P') ||
      state.current.counters.some((each) => each[0] === x && each[1] === row);
    const side = !isUsed(y - 1) ? 'above' : !isUsed(y + 1) ? 'below' : 'feet';
    drawTag(this.context, this.youText, this.#chef(state, seat, now, reduced), side, this.tagScale);
  }

  /** @type {(state: StartedState, seat: number, now: number, reduced: boolean) => Chef} */
  #chef(state, seat, now, reduced) {
    const { seat: own } = state.game;
    const player = state.current.players[seat];
    const [x, y] = reduced ? player : place(state, seat, now);
    return {
      who: own === seat || (own < 0 && seat === 0) ? 'blue' : 'green',
      x,
      y,
      facing: facing(state, seat),
      held: player[3],
      motion: reduced || state.phase !== 'playing' ? null : motion(state, seat, now),
      isOwn: own === seat,
      cellPixels: this.cellPixels,
    };
  }
}

/** Return how many pixels of a board make one CSS pixel. */
export function pixelRatio() {
  return Math.min(MAX_RATIO, window.devicePixelRatio || 1);
}

/**
 * Return how a chef moves within this tick.
 * @type {(state: StartedState, seat: number, now: number) => Motion}
 */
function motion(state, seat, now) {
  const [x, y] = state.current.players[seat];
  const [fromX, fromY] = state.from[seat] ?? [x, y];
  const action = state.actions[seat];
  const walking = Math.abs(x - fromX) + Math.abs(y - fromY) > 0.01;
  const kind = walking ? 'walk' : action < 4 ? 'bump' : action === 5 ? 'use' : 'rest';
  const stride = state.current.t % 2 ? 1 : -1;
  return { kind: state.previous ? kind : 'rest', part: progress(state, now), now, stride };
}
