// Which timestep is shown, and when the next one is. Knows no picture.

export class Player {
  /** `show(t, by)`: 'step' for the one after the last shown, else 'jump'. */
  constructor(show) {
    Object.assign(this, { showing: show, t: 0, speed: 1, playing: false, timer: 0 });
  }

  go(t, last) {
    this.#show(Math.max(0, Math.min(last, t)));
  }

  /** A new last timestep of a game that is followed. */
  follow(t) {
    this.#show(t);
  }

  /** Plays on to the end (from the start, if it stands there). `last()`: the last timestep; `stopped()` is told of the end. */
  play(last, tickMs, stopped) {
    this.stop();
    if (this.t >= last()) this.#show(0);
    this.playing = true;
    const next = () => {
      if (!this.playing) return;
      if (this.t >= last()) { this.stop(); stopped(); return; }
      this.#show(this.t + 1);
      this.timer = setTimeout(next, tickMs / this.speed);
    };
    this.timer = setTimeout(next, tickMs / this.speed);
  }

  stop() {
    this.playing = false;
    clearTimeout(this.timer);
  }

  #show(t) {
    const by = t === this.t + 1 ? 'step' : 'jump';
    this.t = t;
    this.showing(t, by);
  }
}
