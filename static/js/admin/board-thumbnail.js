// A small kitchen in a card, drawn by the game's renderer from the server's messages.

/** @import { Sprites } from '../board/sprites.js' */
/** @import { State } from '../board/state.js' */

import { Renderer } from '../board/renderer.js';
import { apply } from '../board/state.js';
import { boardState, tickOf } from '../board/still-board.js';

export class BoardThumbnail {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Sprites} sprites
   * @param {Researcher.Still} still
   * @param {[width: number, height: number]} size in CSS pixels
   */
  constructor(canvas, sprites, still, size) {
    this.renderer = new Renderer(canvas, sprites, '');
    this.size = size;
    this.still = still;
    /** @type {State | null} */
    this.state = null;
  }

  /**
   * Show the board as it is, without motion.
   * @param {Researcher.Board} board
   */
  show(board) {
    const now = performance.now();
    const before = this.state ?? boardState(this.still, board.state, now);
    this.state = apply(before, tickOf(board), now);
    this.renderer.fit(this.still.grid, ...this.size);
    this.renderer.draw(this.state, now, true);
  }
}
