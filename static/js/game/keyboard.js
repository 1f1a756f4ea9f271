// Listens to the keyboard of the page, and detects whether the participant is present.

/** @import { Change, Keys } from './input.js' */

import { codeOf, isModifier } from './key-names.js';

const WATCH_MS = 250;
const MIN_SILENCE_MS = 1000; // a key that repeated and is silent for longer has been released
const MAX_GAPS = 4; // ... or for longer than this many of its own repeats

/**
 * Listen to the keyboard. A key never stays down because its key-up was lost: keys are released when a modifier or a
 * menu may swallow it, when their repeats stop, and when another press of the same key shows that it was.
 * @param {Keys} keys
 * @param {() => boolean} hasFocus whether keys belong to the game now; only then the page is kept from scrolling
 * @param {(change: Change) => void} changed is called with every change
 */
export function listenToKeyboard(keys, hasFocus, changed) {
  new KeyboardListener(keys, hasFocus, changed).start();
}

class KeyboardListener {
  /**
   * @param {Keys} keys
   * @param {() => boolean} hasFocus
   * @param {(change: Change) => void} changed
   */
  constructor(keys, hasFocus, changed) {
    this.keys = keys;
    this.hasFocus = hasFocus;
    this.changed = changed;
    this.repeats = new KeyRepeats();
    /** @type {Set<string>} pressed keys of a keyboard that sends no codes */
    this.nameless = new Set();
  }

  start() {
    document.addEventListener('keydown', (event) => this.#down(event));
    document.addEventListener('keyup', (event) => this.#up(event));
    for (const kind of ['contextmenu', 'beforeprint', 'dragstart'])
      window.addEventListener(kind, () => this.#doubtAll());
    setInterval(() => this.#watch(), WATCH_MS);
  }

  /** @param {Change | null} change */
  #notify(change) {
    if (change) this.changed(change);
  }

  #doubtAll() {
    this.#notify(this.keys.doubt([...this.keys.actionOf.keys()]));
  }

  /** @param {KeyboardEvent} event */
  #down(event) {
    if (isModifier(event)) this.#doubtAll();
    const code = codeOf(event);
    if (!event.repeat) this.repeats.pressed(code);
    if (!this.hasFocus() || event.ctrlKey || event.metaKey || event.altKey || !this.keys.knows(code)) return;
    event.preventDefault();
    if (event.repeat) {
      this.repeats.repeated(code);
      this.#notify(this.keys.resume(code));
      return;
    }
    if (isNameless(event)) this.nameless.add(code);
    this.keys.release(code); // already down: its key-up was lost
    this.#notify(this.keys.press(code));
  }

  /** @param {KeyboardEvent} event */
  #up(event) {
    if (isModifier(event)) this.#doubtAll();
    for (const code of isNameless(event) ? [...this.nameless] : [codeOf(event)]) {
      this.repeats.released(code);
      this.nameless.delete(code);
      if (this.keys.knows(code)) this.#notify(this.keys.release(code));
    }
  }

  #watch() {
    if (!this.hasFocus() || !document.hasFocus()) this.#doubtAll(); // a dialog, however it was opened
    if (!this.repeats.isSilent) return;
    this.#notify(this.keys.doubt([this.repeats.code]));
    this.repeats.pressed(this.repeats.code);
  }
}

/** @param {KeyboardEvent} event */
function isNameless({ code }) {
  return !code || code === 'Unidentified';
}

/** The repeats of the key pressed last. Only that one repeats, and not on every keyboard: some keys never do. */
class KeyRepeats {
  constructor() {
    this.code = '';
    this.last = 0;
    this.count = 0;
    this.gap = 0;
    this.pressed('');
  }

  /** @param {string} code */
  pressed(code) {
    this.code = code;
    this.last = performance.now();
    this.count = 0;
    this.gap = 0;
  }

  /** @param {string} code */
  repeated(code) {
    if (code !== this.code) return;
    const now = performance.now();
    if (this.count > 0) this.gap = Math.max(this.gap, now - this.last);
    this.count += 1;
    this.last = now;
  }

  /** @param {string} code */
  released(code) {
    if (code === this.code) this.pressed('');
  }

  /** Whether the key repeated and has stopped. */
  get isSilent() {
    return this.count > 1 && performance.now() - this.last > Math.max(MIN_SILENCE_MS, MAX_GAPS * this.gap);
  }
}

/** Whether this browser says that the page has the focus; some, embedded in other programs, never do. */
let focusIsTold = true;

/**
 * Return why the participant is not at the page now; null if they are.
 * @returns {Wire.Away['reason'] | null}
 */
export function absence() {
  if (document.hidden) return 'hidden';
  return document.hasFocus() || !focusIsTold ? null : 'blur';
}

/**
 * Tell when the participant leaves the page and comes back.
 * @param {(reason: Wire.Away['reason']) => void} left
 * @param {() => void} back
 */
export function watchPresence(left, back) {
  window.addEventListener('blur', () => left(document.hidden ? 'hidden' : 'blur'));
  window.addEventListener('focus', () => {
    if (!document.hidden) back();
  });
  document.addEventListener('visibilitychange', () => (document.hidden ? left('hidden') : back()));
  const clicked = () => (focusIsTold = document.hasFocus()); // somebody who clicks is at the page
  window.addEventListener('click', clicked, { capture: true });
}
