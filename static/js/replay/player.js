// Decides which timestep of a replay is shown, and when the next one is.

/** @typedef {'step' | 'jump'} Move step: the timestep after the last one shown */

export class Player {
  /** @param {(t: number, by: Move) => void} show */
  constructor(show) {
    this.show = show;
    this.t = 0;
    this.speed = 1;
    this.playing = false;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
  }

  /**
   * @param {number} t
   * @param {number} last
   */
  go(t, last) {
    this.#show(Math.max(0, Math.min(last, t)));
  }

  /**
   * Show a new last timestep of a running game.
   * @param {number} t
   */
  follow(t) {
    this.#show(t);
  }

  /**
   * Play to the end, or from the start if the end is shown.
   * @param {() => number} last the last timestep
   * @param {number} tickMs
   * @param {() => void} stopped is called at the end
   */
  play(last, tickMs, stopped) {
    this.stop();
    if (this.t >= last()) this.#show(0);
    this.playing = true;
    const next = () => {
      if (!this.playing) return;
      if (this.t >= last()) {
        this.stop();
        stopped();
        return;
      }
      this.#show(this.t + 1);
      this.timer = setTimeout(next, tickMs / this.speed);
    };
    this.timer = setTimeout(next, tickMs / this.speed);
  }

  stop() {
    this.playing = false;
    clearTimeout(this.timer);
  }

  /** @param {number} t */
  #show(t) {
    const by = t === this.t + 1 ? 'step' : 'jump';
    this.t = t;
    this.show(t, by);
  }
}
