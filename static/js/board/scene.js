// A still kitchen beside words: drawn by the game's own renderer, from messages as the server would send them.

import { Renderer } from './renderer.js';
import { Sprites } from './sprites.js';
import { apply, defaults } from './state.js';

const MAX_CELL = 96; // CSS pixels

export class Scene {
  /** `canvas` lies in a box as wide as the picture may be; `youText` stands over the own chef. */
  constructor(canvas, sprites, youText) {
    this.canvas = canvas;
    this.renderer = new Renderer(canvas, sprites, youText);
    this.state = defaults();
    this.grid = null;
    new ResizeObserver(() => this.draw()).observe(canvas.parentElement);
  }

  static async open(canvas, youText) {
    return new Scene(canvas, await new Sprites('/static/sprites/').load(), youText);
  }

  /** Shows one moment of `grid`: {players, pots, counters, prediction, mark}, as in messages.js; `seat`: the own chef. */
  show(grid, moment, seat = 0) {
    this.grid = grid;
    const kitchen = { t: 0, counters: [], pots: [], score: 0, soups: 0, ...moment, players: moment.players };
    const welcome = { type: 'welcome', grid, seat, watched_seat: 1 - seat, tick_ms: 200, horizon: 0, steps: 3, shows_predictions: true, state: kitchen };
    const now = performance.now();
    this.state = apply(defaults(), welcome, now);
    const tick = { type: 'tick', state: kitchen, prediction: moment.prediction ?? [], actions: [4, 4], applied: -1, late: false };
    this.state = { ...apply(this.state, tick, now), phase: 'waiting' };
    this.renderer.spot = moment.mark ?? null;
    this.draw();
  }

  draw() {
    if (!this.grid) return;
    const width = this.canvas.parentElement.clientWidth;
    this.renderer.fit(this.grid, Math.min(width, MAX_CELL * this.grid[0].length), 1e4);
    this.canvas.style.width = '';
    this.canvas.style.height = '';
    this.renderer.draw(this.state, this.state.arrivedMs + 100, true);
  }
}
