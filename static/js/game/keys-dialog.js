// The dialog in which a participant chooses other keys. The choice stays in this browser.

/** @import { Catalogue } from '../browser/texts.js' */
/** @import { Bindings } from './input.js' */
/** @import { KeyboardLayout } from './key-names.js' */

import { find, findAll } from '../browser/dom.js';
import { local, readJson } from '../browser/storage.js';
import { DEFAULT_BINDINGS } from './input.js';
import { codeOf, isModifier, isUsable, keyName } from './key-names.js';

/** @type {Record<string, string>} the texts' names of the actions */
const WORDS = { 0: 'up', 1: 'down', 2: 'right', 3: 'left', 5: 'use', 6: 'marks' };
const STORE = 'kitchenmind.keys';

/**
 * Return the stored keys, or the default ones. Unusable keys are left out; an action without any gets its default ones.
 * @param {Pick<Storage, 'getItem'>} storage
 * @returns {Bindings}
 */
export function storedBindings(storage = local) {
  const stored = readJson(storage, STORE, {});
  /** @type {[string, string[]][]} */
  const own = Object.keys(DEFAULT_BINDINGS).map((action) => {
    return [action, Array.isArray(stored[action]) ? stored[action].filter(isUsable) : []];
  });
  const taken = own.flatMap(([, codes]) => codes);
  /** @type {(action: string) => string[]} */
  const free = (action) => DEFAULT_BINDINGS[action].filter((code) => !taken.includes(code));
  const next = own.map(([action, codes]) => /** @type {const} */ ([action, codes.length ? codes : free(action)]));
  return next.every(([, codes]) => codes.length) ? Object.fromEntries(next) : DEFAULT_BINDINGS;
}

/**
 * Return the bindings with `code` as first key of `action`. No key means two things: an action that loses its only key
 * gets the one that `action` had.
 * @param {Bindings} bindings
 * @param {string} action
 * @param {string} code
 * @returns {Bindings}
 */
export function rebind(bindings, action, code) {
  /** @type {(codes: string[]) => string[]} */
  const others = (codes) => codes.filter((other) => other !== code);
  /** @type {Bindings} */
  const next = Object.fromEntries(Object.entries(bindings).map(([each, codes]) => [each, others(codes)]));
  next[action] = [code];
  for (const each of Object.keys(next)) if (!next[each].length) next[each] = others(bindings[action]).slice(0, 1);
  return Object.values(next).every((codes) => codes.length) ? next : bindings;
}

export class KeysDialog {
  /**
   * @param {HTMLDialogElement} dialog
   * @param {Catalogue} text
   * @param {KeyboardLayout} layout
   * @param {(bindings: Bindings) => void} changed is called with a new choice
   */
  constructor(dialog, text, layout, changed) {
    this.dialog = dialog;
    this.text = text;
    this.layout = layout;
    this.changed = changed;
    this.bindings = storedBindings();
    /** @type {HTMLButtonElement | null} the button that waits for a key */
    this.asking = null;
    this.buttons = findAll('[data-rebind]', HTMLButtonElement, dialog);
    this.note = find('#keys-note', HTMLElement, dialog);
    for (const button of this.buttons) button.addEventListener('click', () => this.#ask(button));
    find('#keys-reset', HTMLElement, dialog).addEventListener('click', () => this.#store(DEFAULT_BINDINGS));
    dialog.addEventListener('keydown', (event) => this.#pressed(event));
  }

  open() {
    this.asking = null;
    this.#show();
    this.dialog.showModal();
  }

  /** Write the names of the keys again: more is known about the keyboard. */
  refresh() {
    this.#show(this.note.textContent ?? '');
  }

  #show(note = '') {
    this.note.textContent = note;
    for (const button of this.buttons) {
      const names = this.bindings[actionOf(button)].map((code) => keyName(code, this.text, this.layout)).join(' / ');
      button.textContent = button === this.asking ? this.text('keys.press') : names;
    }
  }

  /** @param {HTMLButtonElement} button */
  #ask(button) {
    this.asking = this.asking === button ? null : button;
    this.#show();
  }

  /** @param {Bindings} next */
  #store(next) {
    this.asking = null;
    this.bindings = next;
    local.setItem(STORE, JSON.stringify(next));
    this.changed(next);
    this.#show();
  }

  /** @param {KeyboardEvent} event */
  #pressed(event) {
    const code = codeOf(event);
    if (!this.asking || code === 'Tab') return;
    event.preventDefault();
    if (event.repeat) return;
    const isFree = !event.ctrlKey && !event.metaKey && !event.altKey && !isModifier(event);
    if (event.key !== 'Escape' && !(isFree && isUsable(code))) {
      this.#show(this.text('keys.unusable'));
      return;
    }
    const action = actionOf(this.asking);
    // Without this, Space would press the button again.
    this.dialog.addEventListener('keyup', (release) => release.preventDefault(), { once: true });
    if (event.key === 'Escape') this.#ask(this.asking);
    else this.#rebind(action, code);
  }

  /**
   * Give a key to an action, and say which other action had it.
   * @param {string} action
   * @param {string} code
   */
  #rebind(action, code) {
    const loser = Object.keys(this.bindings).find((each) => each !== action && this.bindings[each].includes(code));
    this.#store(rebind(this.bindings, action, code));
    if (loser === undefined) return;
    const button = this.buttons.find((each) => actionOf(each) === loser);
    const other = this.text(`keys.${WORDS[loser]}`);
    this.#show(
      this.text('keys.moved', { key: keyName(code, this.text, this.layout), other, keys: button?.textContent ?? '' }),
    );
  }
}

/** @param {HTMLButtonElement} button */
function actionOf(button) {
  return button.dataset.rebind ?? '';
}
