// Tells screen readers what changed: at most one message every few seconds, urgent ones at once.

/** @import { BoardEvent } from '../board/events.js' */
/** @import { State } from '../board/state.js' */
/** @import { Catalogue } from '../browser/texts.js' */
/** @import { Dialog } from './choose-dialog.js' */

const PAUSE_MS = 2500;
const SECONDS_ANNOUNCED = [30, 10];

export class Announcer {
  /**
   * @param {HTMLElement} polite
   * @param {HTMLElement} urgent
   * @param {Catalogue} text
   */
  constructor(polite, urgent, text) {
    this.polite = polite;
    this.urgent = urgent;
    this.text = text;
    this.lastMs = -Infinity;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
    this.announcedSeconds = Infinity;
    this.announcedIntention = '';
  }

  /**
   * Announce it when enough time has passed; a later message replaces one that still waits.
   * @param {string} words
   */
  say(words) {
    const now = performance.now();
    clearTimeout(this.timer);
    const wait = this.lastMs + PAUSE_MS - now;
    if (wait > 0) {
      this.timer = setTimeout(() => this.say(words), wait);
      return;
    }
    this.lastMs = now;
    this.polite.textContent = words;
  }

  /**
   * Announce it now.
   * @param {string} words
   */
  sayNow(words) {
    this.urgent.textContent = words;
  }

  /**
   * Announce what happened in a tick.
   * @param {BoardEvent[]} list
   * @param {State} state
   */
  happened(list, { current }) {
    if (!current) return;
    const { score, soups } = current;
    if (list.some(({ kind }) => kind === 'delivery')) this.say(this.text('say.delivered', { score, soups }));
    else if (list.some(({ kind }) => kind === 'ready')) this.say(this.text('say.ready'));
  }

  /**
   * Announce another intention of the partner, if no other announcement is due.
   * @param {string} words '' for none
   */
  intention(words) {
    if (words === this.announcedIntention || performance.now() < this.lastMs + PAUSE_MS) return;
    this.announcedIntention = words;
    if (words) this.say(words);
  }

  /**
   * Announce thirty and ten seconds before the end.
   * @param {number | null} seconds left
   */
  time(seconds) {
    if (seconds === null) return;
    for (const mark of SECONDS_ANNOUNCED) {
      if (seconds <= mark && this.announcedSeconds > mark) this.say(this.text('say.seconds', { seconds: mark }));
    }
    this.announcedSeconds = seconds;
  }

  /**
   * Announce another dialog.
   * @param {Dialog} dialog
   * @param {State} state
   */
  dialog({ name, reason, seconds }, { ended }) {
    if (name === 'pause' || name === 'banner') {
      this.sayNow(`${this.text(`${name}.${reason}.title`)}. ${this.text(`${name}.${reason}.text`)}`);
    }
    if (name === 'count') {
      this.sayNow(this.text(reason === 'begin' ? 'say.begin' : 'say.count', { seconds: seconds ?? 0 }));
    }
    if (name === 'over' && ended) this.sayNow(this.text('say.over', { score: ended.score, soups: ended.soups }));
  }
}
