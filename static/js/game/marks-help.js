// Explains the marks on request: a small kitchen in slow motion, in which a chef takes the steps that its marks showed.

/** @import { State } from '../board/state.js' */
/** @import { Catalogue } from '../browser/texts.js' */

import { intentionWords } from '../board/intention.js';
import { UNSHOWN } from '../board/kitchen.js';
import { ACTIONS, GRID, nextMoment } from '../board/marks-example.js';
import { Renderer } from '../board/renderer.js';
import { Sprites } from '../board/sprites.js';
import { find } from '../browser/dom.js';

const SLOWER = 6; // than the game
const STEP_MS = 2400;
const LAST = ACTIONS.length;
/** Names of the actions, as keys of the legend. */
const WORDS = ['walk', 'walk', 'walk', 'walk', 'wait', 'use'];

export class MarksHelp {
  /**
   * @param {HTMLDialogElement} dialog
   * @param {HTMLButtonElement[]} buttons each opens it
   * @param {Sprites} sprites
   * @param {Catalogue} text
   */
  constructor(dialog, buttons, sprites, text) {
    this.dialog = dialog;
    this.buttons = buttons;
    this.offered = false;
    this.text = text;
    this.canvas = find('canvas', HTMLCanvasElement, dialog);
    this.lead = find('#marks-help-lead', HTMLElement, dialog);
    this.step = find('#marks-help-text', HTMLElement, dialog);
    this.playButton = find('#marks-help-play', HTMLButtonElement, dialog);
    this.renderer = new Renderer(this.canvas, new Sprites(sprites.folder), text('you_tag'));
    this.renderer.sprites.images = sprites.images; // loaded once for both boards
    this.renderer.greysOldMarks = false;
    this.still = matchMedia('(prefers-reduced-motion: reduce)');
    /** @type {{ steps: number, display: Wire.Welcome['display'] }} */
    this.shown = { steps: 3, display: 'actions' };
    this.plays = false;
    this.sinceMs = 0;
    /** @type {State | null} */
    this.state = null;
    for (const button of buttons) button.addEventListener('click', () => this.open());
    this.playButton.addEventListener('click', () => this.#play(!this.plays));
    find('#marks-help-step', HTMLElement, dialog).addEventListener('click', () => this.#stepByHand());
    document.addEventListener('keydown', (event) => this.#pressed(event));
  }

  /**
   * Offer the explanation if marks are shown and no round is running.
   * @param {State} state
   */
  offer({ game, phase }) {
    this.shown = { steps: game?.steps || 3, display: game?.display ?? 'actions' };
    const busy = game?.kind === 'episode' && ['playing', 'countdown'].includes(phase);
    this.offered = Boolean(game?.shows_predictions) && !busy;
    for (const button of this.buttons) {
      button.hidden = !game?.shows_predictions;
      button.disabled = busy;
    }
  }

  open() {
    if (!this.offered || this.dialog.open) return;
    this.dialog.showModal();
    const { display } = this.shown;
    this.lead.textContent = this.text(display === 'actions' ? 'help.lead' : `help.lead_${display}`);
    this.renderer.text = display === 'actions' ? null : this.text;
    this.state = null;
    this.playButton.hidden = this.still.matches;
    this.#step();
    this.#play(!this.still.matches);
    if (this.still.matches) find('#marks-help-step', HTMLElement, this.dialog).focus();
  }

  /** @param {KeyboardEvent} event */
  #pressed(event) {
    if (event.key !== '?' || event.ctrlKey || event.metaKey || event.altKey) return;
    if (document.querySelector('dialog[open]')) return;
    this.open();
  }

  /** @param {boolean} plays */
  #play(plays) {
    this.plays = plays;
    this.playButton.textContent = this.text(plays ? 'help.pause' : 'help.play');
    this.step.setAttribute('aria-live', plays ? 'off' : 'polite');
    this.sinceMs = performance.now();
    requestAnimationFrame((now) => this.#frame(now));
  }

  #stepByHand() {
    this.#play(false);
    this.#step();
  }

  /** Show the next action of the chef; after the last one, start again. */
  #step() {
    const done = this.state?.current?.t ?? 0;
    this.sinceMs = performance.now();
    this.state = nextMoment(done >= LAST ? null : this.state, this.shown, 0);
    this.step.textContent = this.#words(this.state.current?.t ?? 0);
    this.renderer.applyEvents(this.state, 0);
    this.#draw(this.sinceMs);
  }

  /** @param {number} done */
  #words(done) {
    if (this.shown.display === 'intention') return this.#intentionWords(done);
    const next = ACTIONS[done] ?? UNSHOWN;
    if (next === UNSHOWN) return this.text('help.again');
    const words = this.text(`legend.${done === 3 ? 'turn' : WORDS[next]}`);
    return this.text(done ? 'help.then' : 'help.first', { step: words });
  }

  /** @param {number} done */
  #intentionWords(done) {
    const intention = this.state?.intention;
    if (!intention) return this.text('help.did');
    return this.text(done ? 'help.intends_still' : 'help.intends', {
      words: intentionWords(intention, GRID, this.text),
    });
  }

  /** @param {number} now */
  #frame(now) {
    if (!this.dialog.open) return;
    if (this.plays && now - this.sinceMs > STEP_MS) this.#step();
    this.#draw(now);
    if (this.plays || now - this.sinceMs < STEP_MS) requestAnimationFrame((next) => this.#frame(next));
  }

  /** @param {number} now */
  #draw(now) {
    if (!this.state) return;
    const width = (this.canvas.parentElement ?? this.canvas).clientWidth;
    this.renderer.fit(GRID, width, (width * GRID.length) / GRID[0].length);
    this.renderer.draw(this.state, Math.max(0, now - this.sinceMs) / SLOWER, this.still.matches);
  }
}
