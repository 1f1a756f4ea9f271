// How a participant asks for the marks where a study shows them on demand: the legend's line, the button, the key.

/** @import { State } from '../board/state.js' */
/** @import { Catalogue } from '../browser/texts.js' */

import { find, findAll } from '../browser/dom.js';

export class MarksControl {
  /**
   * @param {HTMLElement} page
   * @param {Catalogue} text
   * @param {() => Record<string, string | Node>} keyCaps gives the element for {marks}
   */
  constructor(page, text, keyCaps) {
    this.line = find('#legend-ask', HTMLElement, page);
    this.button = find('.touch .ask', HTMLButtonElement, page);
    this.parts = findAll('[data-on-demand]', HTMLElement, page);
    this.note = find('#legend-predictions [data-always]', HTMLElement, page);
    this.text = text;
    this.keyCaps = keyCaps;
    this.shown = '';
  }

  /** Update the line at the next opportunity, because it names another key. */
  rewrite() {
    this.shown = '';
  }

  /** @param {State} state */
  show({ game, asked }) {
    const show = game?.show ?? 'always';
    if (show === 'toggle') this.button.setAttribute('aria-pressed', String(asked));
    if (show === this.shown) return;
    this.shown = show;
    for (const part of this.parts) part.hidden = show === 'always';
    this.note.hidden = show !== 'always'; // the line takes its place
    if (show === 'always') return;
    this.line.replaceChildren(...this.text.nodes(`legend.${show}`, this.keyCaps()));
    find('small', HTMLElement, this.button).textContent = this.text(`keys.marks_${show}`);
  }
}
