// Puts the dialog that choose-dialog.js chose on the page: start, countdown, pause, banner, end, other tab.

/** @import { State } from '../board/state.js' */
/** @import { Catalogue } from '../browser/texts.js' */
/** @import { Dialog, DialogName } from './choose-dialog.js' */
/** @import { RoundScore } from './result.js' */

import { root } from '../browser/addresses.js';
import { find } from '../browser/dom.js';
import { showBowls, showCurve } from './result.js';

/** @type {DialogName[]} dialogs with an element of that id in the page of the game */
const PARTS = ['start', 'count', 'pause', 'banner', 'over', 'closed'];
/** @type {DialogName[]} */
const VEILED = ['start', 'count', 'pause', 'over', 'closed'];
/** @type {Partial<Record<DialogName, string>>} */
const SECONDS = { start: '#start-left', pause: '#pause-left', banner: '#banner-left' };
/** For whom a pause waits, by its reason; otherwise it is the participant.
 * @type {Record<string, 'partner' | 'room'>} */
const OTHERS = { partner: 'partner', researcher: 'partner', room: 'room' };
const MAX_ROUNDS_SHOWN = 20;
const BUTTON_PAUSE_MS = 700;

export class Dialogs {
  /**
   * @param {HTMLElement} page the game's element
   * @param {Catalogue} text
   * @param {{ ready(): void, takeOver(): void, reload(): void }} actions
   * @param {RoundScore[]} rounds the participant's earlier rounds
   */
  constructor(page, text, actions, rounds = []) {
    this.page = page;
    this.text = text;
    this.rounds = rounds;
    this.shown = '';
    this.#find('#start-button').addEventListener('click', actions.ready);
    this.#find('#pause-button').addEventListener('click', actions.ready);
    this.#find('#closed-button').addEventListener('click', actions.reload);
    find('#other-here', HTMLElement).addEventListener('click', actions.takeOver);
    find('#other-stay', HTMLElement).addEventListener('click', () => this.#stay());
  }

  /**
   * Show the dialog. Returns true if it is another one than before.
   * @param {Dialog} dialog
   * @param {State} state
   */
  show(dialog, state) {
    const same = `${dialog.name}:${dialog.reason}`;
    const changed = same !== this.shown;
    if (changed) this.#swap(dialog, state);
    this.shown = same;
    this.#seconds(dialog);
    return changed;
  }

  /** @param {string} selector */
  #find(selector) {
    return find(selector, HTMLElement, this.page);
  }

  /**
   * @param {string} selector
   * @param {string} words
   */
  #write(selector, words) {
    this.#find(selector).textContent = words;
  }

  /**
   * @param {Dialog} dialog
   * @param {State} state
   */
  #swap(dialog, state) {
    for (const name of PARTS) this.#find(`#${name}`).hidden = dialog.name !== name;
    this.#find('#veil').hidden = !VEILED.includes(dialog.name);
    this.#find('.stage').classList.toggle('dim', dialog.name === 'banner' || dialog.name === 'closed');
    this.page.hidden = dialog.name === 'other';
    find('#other', HTMLElement).hidden = dialog.name !== 'other';
    if (dialog.name === 'count') this.#titleAndText(`count.${dialog.reason}`, 'count');
    if (dialog.name === 'start' && state.game) this.#start(dialog, state.game);
    if (dialog.name === 'pause') this.#pause(dialog);
    if (dialog.name === 'banner') this.#titleAndText(`banner.${dialog.reason}`, 'banner');
    if (dialog.name === 'over' && state.ended) this.#over(state.ended, state.game);
    if (dialog.name === 'closed') this.#find('#closed-button').focus({ preventScroll: true });
    if (dialog.name === 'other') find('#other-here', HTMLElement).focus();
  }

  /**
   * @param {string} key
   * @param {string} id
   * @param {Record<string, string | number>} values
   */
  #titleAndText(key, id, values = {}) {
    this.#write(`#${id}-title`, this.text(`${key}.title`, values));
    this.#write(`#${id}-text`, this.text(`${key}.text`, values));
  }

  /**
   * @param {Dialog} dialog
   * @param {Wire.Welcome} game
   */
  #start(dialog, game) {
    const kind = dialog.reason === 'episode' && game.partner === 'human' ? 'together' : dialog.reason;
    const seconds = Math.round((game.horizon * game.tick_ms) / 1000);
    const values = { number: game.number, episodes: game.episodes, title: game.title, seconds };
    this.#titleAndText(`start.${kind}`, 'start', values);
    this.#write('#start-button', this.text(`start.${kind}.button`, values));
    this.#find('#start-button').focus({ preventScroll: true });
    showRounds(this.#find('#track'), game);
  }

  /** @param {Dialog} dialog */
  #pause(dialog) {
    this.#titleAndText(`pause.${dialog.reason}`, 'pause');
    const button = this.#find('#pause-button');
    button.hidden = !dialog.action;
    if (!dialog.action) return;
    button.textContent = this.text(`pause.${dialog.reason}.button`);
    button.focus({ preventScroll: true });
  }

  /**
   * @param {Wire.Ended} ended
   * @param {Wire.Welcome | null} game
   */
  #over(ended, game) {
    const kind = endKind(ended, game);
    this.#write('#over-title', this.text(`over.${kind}.title`));
    const served = kind === 'episode' && ended.soups > 0;
    this.#write('#over-text', this.text(served ? 'over.episode.served' : `over.${kind}.text`));
    this.#write('#over-score', String(ended.score));
    this.#write('#over-soups', String(ended.soups));
    this.#result(ended, kind === 'episode' ? game : null);
    const link = find('#over-next', HTMLAnchorElement, this.page);
    const next = new URL(root + ended.next, location.href);
    link.href = next.origin === location.origin ? next.pathname + next.search : `${root}/`;
    link.textContent = this.text(`over.${kind}.button`);
    // A participant who is still pressing keys must not press the button unintentionally.
    link.classList.add('wait');
    setTimeout(() => {
      link.classList.remove('wait');
      link.focus({ preventScroll: true });
    }, BUTTON_PAUSE_MS);
  }

  /**
   * Show the bowls of this game and, after a round of a study, the own points over the rounds.
   * @param {Wire.Ended} ended
   * @param {Wire.Welcome | null} game a round of a study
   */
  #result({ score, soups }, game) {
    showBowls(this.#find('#over-bowls'), find('#over > img', HTMLImageElement, this.page), soups);
    const rounds = game ? [...this.rounds, { number: game.number, score }] : [];
    showCurve(this.#find('#over-curve'), rounds, this.text);
  }

  /** @param {Dialog} dialog */
  #seconds(dialog) {
    if (dialog.name === 'count') this.#countdown(dialog.seconds ?? 0);
    const place = SECONDS[dialog.name];
    if (!place) return;
    const words = dialog.seconds ? this.#timeLeft(dialog.seconds, dialog) : ''; // when it is over, none are left
    const element = this.#find(place);
    if (element.textContent !== words) element.textContent = words;
  }

  /**
   * Show what happens after these seconds, which are not the time left in the round.
   * @param {number} seconds
   * @param {Dialog} dialog
   */
  #timeLeft(seconds, { name, reason }) {
    const time = seconds === 1 ? this.text('one_second') : this.text('some_seconds', { seconds });
    if (name === 'start' && reason !== 'resumed') return this.text('left.start', { time });
    return this.text(`left.${name === 'banner' ? 'lost' : (OTHERS[reason] ?? 'own')}`, { time });
  }

  /** @param {number} seconds */
  #countdown(seconds) {
    for (const dot of this.#find('#count-numbers').children) {
      const number = Number(dot.textContent);
      dot.classList.toggle('now', number === seconds);
      dot.classList.toggle('past', number > seconds);
    }
  }

  #stay() {
    const note = find('#other-note', HTMLElement);
    note.textContent = note.dataset.stayed ?? '';
    window.close(); // works only for tabs that a script opened; the note remains for all others
  }
}

/**
 * Return which texts tell how a game ended.
 * @param {Wire.Ended} ended
 * @param {Wire.Welcome | null} game
 */
function endKind({ passed, reason }, game) {
  const forTwo = game?.partner === 'human';
  if (game?.kind === 'watch') return 'watched';
  if (game?.kind === 'tutorial') return passed ? 'passed' : reason === 'away' ? 'paused' : 'again';
  if (passed) return 'episode';
  if (reason === 'away') return forTwo ? 'parted' : 'away';
  return forTwo && reason === 'withdrawn' ? 'left' : 'stopped';
}

/**
 * Show the row of rounds: done, now, to come.
 * @param {HTMLElement} list
 * @param {Wire.Welcome} game
 */
function showRounds(list, { kind, number, episodes }) {
  list.hidden = kind !== 'episode' || episodes < 2;
  const count = Math.min(episodes, MAX_ROUNDS_SHOWN);
  const items = Array.from({ length: count }, (_, index) => {
    const item = document.createElement('li');
    item.textContent = String(index + 1);
    item.className = index + 1 < number ? 'done' : index + 1 === number ? 'now' : '';
    if (index + 1 === number) item.setAttribute('aria-current', 'step');
    return item;
  });
  list.replaceChildren(...items);
}
