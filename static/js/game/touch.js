// The touch pad: buttons on the screen that act as keys. Several fingers at once; a finger may slide to the next arrow.

/** @import { Change, Keys } from './input.js' */

import { MARKS } from './input.js';

const TICK_MS = 8;

/**
 * @param {HTMLElement} pad its buttons have data-action
 * @param {Keys} keys
 * @param {() => boolean} isPlaying
 * @param {(change: Change) => void} changed is called with every change
 */
export function listenTouch(pad, keys, isPlaying, changed) {
  new TouchPad(keys, isPlaying, changed).start(pad);
}

class TouchPad {
  /**
   * @param {Keys} keys
   * @param {() => boolean} isPlaying
   * @param {(change: Change) => void} changed
   */
  constructor(keys, isPlaying, changed) {
    this.keys = keys;
    this.isPlaying = isPlaying;
    this.changed = changed;
    /** @type {Map<number, HTMLElement>} pointer id -> button */
    this.fingers = new Map();
    /** @type {Map<number, string>} pointer id -> touch, mouse or pen */
    this.kinds = new Map();
  }

  /**
   * A browser may not tell when a finger is lifted, for example from a button that was disabled in the meantime. Other
   * events show it too.
   * @param {HTMLElement} pad
   */
  start(pad) {
    pad.addEventListener('pointerdown', (event) => this.#down(event));
    pad.addEventListener('click', (event) => this.#click(event));
    document.addEventListener('pointermove', (event) => this.#move(event));
    window.addEventListener('pointerup', (event) => this.#lift(event.pointerId), true);
    window.addEventListener('pointercancel', (event) => this.#lift(event.pointerId), true);
    for (const kind of /** @type {const} */ (['touchend', 'touchcancel'])) {
      const lifted = (/** @type {TouchEvent} */ event) => {
        if (event.touches.length === 0) this.#liftAll('touch');
      };
      window.addEventListener(kind, lifted, { capture: true, passive: true });
    }
  }

  /** @param {Change | null} change */
  #notify(change) {
    if (change) this.changed(change);
  }

  /** @param {PointerEvent} event */
  #down(event) {
    const button = buttonOf(event.target, '[data-action]');
    if (!button || !this.isPlaying()) return;
    event.preventDefault();
    if (event.isPrimary) this.#liftAll(event.pointerType); // the first of its kind: the others are gone
    button.releasePointerCapture?.(event.pointerId);
    this.kinds.set(event.pointerId, event.pointerType);
    this.#put(event.pointerId, button);
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (event.buttons === 0) this.#lift(event.pointerId);
    const from = this.fingers.get(event.pointerId);
    if (!from || !from.closest('.pad')) return;
    const to = buttonOf(document.elementFromPoint(event.clientX, event.clientY), '.pad [data-action]');
    if (!to || to === from) return;
    this.#lift(event.pointerId);
    this.#put(event.pointerId, to);
  }

  /**
   * A button pressed without a pointer (screen reader, switch control) is a tap. The one that asks for the marks stays
   * down until it is pressed again.
   * @param {MouseEvent} event
   */
  #click(event) {
    const button = buttonOf(event.target, '[data-action]');
    if (!button || event.detail !== 0 || !this.isPlaying()) return;
    const action = Number(button.dataset.action);
    const isDown = this.keys.isDown(`touch-click-${action}`);
    if (!isDown) this.#notify(this.keys.press(`touch-click-${action}`, action));
    if (isDown || action !== MARKS) this.#notify(this.keys.release(`touch-click-${action}`));
  }

  /**
   * @param {number} pointer
   * @param {HTMLElement} button
   */
  #put(pointer, button) {
    this.fingers.set(pointer, button);
    button.classList.add('down');
    navigator.vibrate?.(TICK_MS); // where there is a motor: a key that can be felt
    this.#notify(this.keys.press(keyOf(pointer, button), Number(button.dataset.action)));
  }

  /** @param {number} pointer */
  #lift(pointer) {
    const button = this.fingers.get(pointer);
    if (!button) return;
    this.fingers.delete(pointer);
    button.classList.remove('down');
    this.#notify(this.keys.release(keyOf(pointer, button)));
  }

  /** @param {string} kind */
  #liftAll(kind) {
    for (const pointer of [...this.fingers.keys()]) if (this.kinds.get(pointer) === kind) this.#lift(pointer);
  }
}

/** @type {(pointer: number, button: HTMLElement) => string} */
function keyOf(pointer, button) {
  return `touch-${pointer}-${button.dataset.action}`;
}

/**
 * @param {EventTarget | null} target
 * @param {string} selector
 * @returns {HTMLElement | null}
 */
function buttonOf(target, selector) {
  return target instanceof Element ? target.closest(selector) : null;
}
