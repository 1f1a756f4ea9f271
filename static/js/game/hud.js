// Title, time, score and soups above the kitchen. Writes an element only when its words change.

import { secondsLeft } from '../board/state.js';

const HURRY_S = 10;

export class Hud {
  constructor(page, text) {
    Object.assign(this, { page, text, score: null, game: null });
    this.find = (selector) => page.querySelector(selector);
  }

  /** Shows the state. */
  show(state, reduced) {
    if (!state.game) return;
    if (state.game !== this.game) this.#title(state.game);
    this.#time(state);
    this.#write('#soups', state.current.soups);
    if (this.#write('#score', state.current.score) && state.current.score > (this.score ?? Infinity) && !reduced) this.#bump();
    this.score = state.current.score;
  }

  #title(game) {
    this.game = game;
    this.score = null;
    const practice = game.kind === 'tutorial';
    const kind = practice ? 'practice' : game.kind === 'watch' ? 'watch' : 'round';
    this.#write('#title', practice ? this.text('practice') : game.title);
    this.#write('#round', this.text(`${kind}_note`, { number: game.number, episodes: game.episodes }));
    this.find('.stat.time').hidden = game.endless;
    for (const name of ['predictions', 'pots']) this.find(`#legend-${name}`).hidden = (name === 'predictions') !== game.shows_predictions;
    this.find('#ids').hidden = practice || game.seat < 0;
    this.#write('#partner', this.text(game.partner === 'human' ? 'partner_human' : 'partner'));
    this.find('#legend').hidden = practice;
    this.find('#lessons').hidden = !practice;
    for (const controls of ['.panel.kb', '.touch']) this.find(controls).hidden = game.seat < 0; // who only watches has none
    document.title = practice ? this.text('practice') : `${game.title} · ${this.text('round_note', { number: game.number, episodes: game.episodes })}`;
  }

  #time(state) {
    const seconds = secondsLeft(state);
    if (seconds === null) return;
    const whole = Math.ceil(seconds - 1e-6);
    if (!this.#write('#time', `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, '0')}`) && this.share !== undefined) return;
    const { horizon, tick_ms: tickMs } = state.game;
    this.share = seconds / (horizon * tickMs / 1000);
    this.find('#time-bar').style.transform = `scaleX(${this.share})`;
    this.find('.stat.time').classList.toggle('hurry', whole <= HURRY_S);
  }

  #bump() {
    const element = this.find('#score');
    element.classList.remove('bump');
    void element.offsetWidth; // restarts the animation
    element.classList.add('bump');
  }

  #write(selector, words) {
    const element = this.find(selector);
    if (element.textContent === String(words)) return false;
    element.textContent = words;
    return true;
  }
}
