// A small kitchen in a card, drawn by the game's own renderer. Feeds it what the server said; plays nothing.

import { Renderer } from '../board/renderer.js';
import { apply, defaults } from '../board/state.js';

export class SmallBoard {
  /** `still`: grid, seat, watched_seat, tick_ms, horizon. */
  constructor(canvas, sprites, still, width, height) {
    this.renderer = new Renderer(canvas, sprites, '');
    this.size = [width, height];
    this.still = still;
    this.state = null;
  }

  /** Shows {state, prediction, actions} as it is, without motion. */
  show(board) {
    const now = performance.now();
    const welcome = { type: 'welcome', ...this.still, state: board.state, endless: !this.still.horizon };
    this.state ??= apply(defaults(), welcome, now);
    this.state = apply({ ...this.state, phase: 'playing' }, { type: 'tick', applied: -1, ...board }, now);
    this.draw(now);
  }

  draw(now = performance.now()) {
    this.renderer.fit(this.still.grid, ...this.size);
    this.renderer.draw(this.state, now, true);
  }
}
