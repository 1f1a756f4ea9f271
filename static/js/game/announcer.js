// Tells screen readers what changed: at most one message each few seconds, urgent ones at once. No flood of ticks.

const PAUSE_MS = 2500;

export class Announcer {
  constructor(polite, urgent, text) {
    Object.assign(this, { polite, urgent, text, lastMs: -Infinity, waiting: null, timer: 0, toldSeconds: Infinity });
  }

  /** Says it when there is room; a later message takes the place of one that still waits. */
  say(words) {
    const now = performance.now();
    clearTimeout(this.timer);
    const wait = this.lastMs + PAUSE_MS - now;
    if (wait > 0) { this.timer = setTimeout(() => this.say(words), wait); return; }
    this.lastMs = now;
    this.polite.textContent = words;
  }

  /** Says it now. */
  shout(words) {
    this.urgent.textContent = words;
  }

  /** What happened in a tick (events.js). */
  happened(list, state) {
    const { score, soups } = state.current;
    if (list.some(({ kind }) => kind === 'delivery')) this.say(this.text('say.delivered', { score, soups }));
    else if (list.some(({ kind }) => kind === 'ready')) this.say(this.text('say.ready'));
  }

  /** Thirty and ten seconds before the end. */
  time(seconds) {
    if (seconds === null) return;
    for (const mark of [30, 10]) if (seconds <= mark && this.toldSeconds > mark) this.say(this.text('say.seconds', { seconds: mark }));
    this.toldSeconds = seconds;
  }

  /** Another message lies over the kitchen (choose-dialog.js). */
  view(view, state) {
    const words = {
      pause: () => `${this.text(`pause.${view.reason}.title`)}. ${this.text(`pause.${view.reason}.text`)}`,
      banner: () => `${this.text(`banner.${view.reason}.title`)}. ${this.text(`banner.${view.reason}.text`)}`,
      count: () => this.text('say.count', { seconds: view.seconds }),
      over: () => this.text('say.over', { score: state.ended.score, soups: state.ended.soups }),
    }[view.name];
    if (words) this.shout(words());
  }
}
