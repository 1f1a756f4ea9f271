// Title, time, score and soups above the kitchen. An element is written only when its text changes.

/** @import { State } from '../board/state.js' */
/** @import { Catalogue } from '../browser/texts.js' */

import { COOK_TIME } from '../board/kitchen.js';
import { isStarted, secondsLeft } from '../board/state.js';
import { find, findAll } from '../browser/dom.js';

const URGENT_S = 10;

export class Hud {
  /**
   * @param {HTMLElement} page
   * @param {Catalogue} text
   */
  constructor(page, text) {
    this.page = page;
    this.text = text;
    /** @type {number | null} */
    this.score = null;
    /** @type {Wire.Welcome | null} */
    this.game = null;
    this.timeShown = false;
    this.tabTitle = '';
  }

  /**
   * Show on the tab that somebody waits there for the participant, who looks at another tab.
   * @param {boolean} isAwaited
   */
  call(isAwaited) {
    if (!this.tabTitle) return;
    const title = isAwaited ? this.text('partner_waits') : this.tabTitle;
    if (document.title !== title) document.title = title;
  }

  /**
   * @param {State} state
   * @param {boolean} reduced less motion
   */
  show(state, reduced) {
    if (!isStarted(state)) return;
    if (state.game !== this.game) this.#title(state.game);
    this.#time(state);
    this.#write('#soups', state.current.soups);
    const { score } = state.current;
    if (this.#write('#score', score) && score > (this.score ?? Infinity) && !reduced) this.#bump();
    this.score = score;
  }

  /** @param {string} selector */
  #find(selector) {
    return find(selector, HTMLElement, this.page);
  }

  /** @param {Wire.Welcome} game */
  #title(game) {
    this.game = game;
    this.score = null;
    const practice = game.kind === 'tutorial';
    const kind = practice ? 'practice' : game.kind === 'watch' ? 'watch' : 'round';
    const numbers = { number: game.number, episodes: game.episodes };
    const title = practice ? this.text('practice') : game.title;
    this.#write('#title', title);
    this.#write('#round', `${this.text(`${kind}_note`, numbers)}${this.#view(game)}`);
    this.#write('#partner', this.text(game.partner === 'human' ? 'partner_human' : 'partner'));
    this.tabTitle = practice ? title : `${title} · ${this.text('round_note', numbers)}`;
    document.title = this.tabTitle;
    this.#find('.stat.time').hidden = game.endless;
    this.#find('#legend-predictions').hidden = !game.shows_predictions;
    this.#find('#legend-pots').hidden = game.shows_predictions;
    for (const part of findAll('[data-display]', HTMLElement, this.page)) {
      const isOne = part.dataset.display === game.display;
      part.hidden = !isOne && (game.display !== 'both' || part.dataset.alone !== undefined);
    }
    this.#cutToSteps(game);
    this.#write('#legend-cooking', this.text('pots.cooking_more', { time: this.#cookingTime(game) }));
    this.#find('#ids').hidden = practice || game.seat < 0;
    this.#find('#legend').hidden = practice;
    this.#find('#legend').classList.toggle('full', game.display === 'both');
    this.#find('#lessons').hidden = !practice;
    for (const controls of ['.panel.kb', '.touch']) this.#find(controls).hidden = game.seat < 0; // only watching
  }

  /** @param {Wire.Welcome} game */
  #view({ view_radius: cells }) {
    if (!cells) return '';
    return ` · ${cells === 1 ? this.text('view_note_one') : this.text('view_note', { cells })}`;
  }

  /**
   * Explain the order of as many steps as are drawn; a single step has none.
   * @param {Wire.Welcome} game
   */
  #cutToSteps({ steps }) {
    const order = this.#find('#legend-order');
    if (steps === 1) order.hidden = true;
    findAll('span', HTMLElement, order).forEach((each, k) => {
      each.hidden = k >= steps;
    });
  }

  /** @param {Wire.Welcome} game */
  #cookingTime({ tick_ms: tickMs }) {
    const seconds = Math.round((COOK_TIME * tickMs) / 100) / 10;
    return seconds === 1 ? this.text('one_second') : this.text('some_seconds', { seconds });
  }

  /** @param {State} state */
  #time(state) {
    const seconds = secondsLeft(state);
    if (seconds === null || !state.game) return;
    const whole = Math.ceil(seconds - 1e-6);
    const clock = `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, '0')}`;
    if (!this.#write('#time', clock) && this.timeShown) return;
    this.timeShown = true;
    const { horizon, tick_ms: tickMs } = state.game;
    this.#find('#time-bar').style.transform = `scaleX(${seconds / ((horizon * tickMs) / 1000)})`;
    this.#find('.stat.time').classList.toggle('urgent', whole <= URGENT_S);
  }

  #bump() {
    const element = this.#find('#score');
    element.classList.remove('bump');
    void element.offsetWidth; // restarts the animation
    element.classList.add('bump');
  }

  /**
   * @param {string} selector
   * @param {string | number} value
   * @returns {boolean} whether the text has changed
   */
  #write(selector, value) {
    const element = this.#find(selector);
    if (element.textContent === String(value)) return false;
    element.textContent = String(value);
    return true;
  }
}
