// A still kitchen next to text, drawn by the game's renderer from messages as the server would send them.

/** @import { Cell, Grid, Player } from './kitchen.js' */

import { SPRITES } from '../browser/addresses.js';
import { Renderer } from './renderer.js';
import { Sprites } from './sprites.js';
import { apply, defaults } from './state.js';
import { boardState, tickOf } from './still-board.js';

/** @type {Wire.Tick['intention']} */
const NOTHING = [8, -1, -1, 95];
const MAX_CELL = 96; // CSS pixels

/** @typedef {{ players: Player[], prediction?: [action: number, percent: number][],
 *   intention?: Wire.Tick['intention'], mark?: Cell }} Shown mark: the cell
 *   to highlight */
/** @typedef {Partial<Wire.KitchenState> & Shown} Moment */

export class Scene {
  /**
   * @param {HTMLCanvasElement} canvas lies in a box as wide as the picture may be
   * @param {Sprites} sprites
   * @param {string} youText the tag over the own chef
   */
  constructor(canvas, sprites, youText) {
    this.canvas = canvas;
    this.box = canvas.parentElement ?? canvas;
    this.renderer = new Renderer(canvas, sprites, youText);
    this.state = defaults();
    new ResizeObserver(() => this.draw()).observe(this.box);
  }

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {string} youText
   */
  static async open(canvas, youText) {
    return new Scene(canvas, await new Sprites(SPRITES).load(), youText);
  }

  /**
   * Show one moment of a grid.
   * @param {Grid} grid
   * @param {Moment} moment
   * @param {number} seat of the own chef
   */
  show(grid, moment, seat = 0) {
    const { prediction = [], intention = NOTHING, mark = null, ...kitchen } = moment;
    /** @type {Wire.KitchenState} */
    const state = { t: 0, counters: [], pots: [], score: 0, soups: 0, ...kitchen };
    const now = performance.now();
    const start = boardState({ grid, seat, watched_seat: 1 - seat, tick_ms: 200, horizon: 0 }, state, now);
    this.state = {
      ...apply(start, tickOf({ state, prediction, intention }), now),
      phase: /** @type {const} */ ('waiting'),
    };
    this.renderer.highlight = mark;
    this.draw();
  }

  draw() {
    const grid = this.state.game?.grid;
    if (!grid) return;
    this.renderer.fit(grid, Math.min(this.box.clientWidth, MAX_CELL * grid[0].length), 1e4);
    this.canvas.style.width = '';
    this.canvas.style.height = '';
    this.renderer.draw(this.state, this.state.arrivedMs + 100, true);
  }
}
