// Keys -> what the chef shall do. `Keys` is plain logic (no DOM); `listen` ties it to the keyboard of a page.

import { INTERACT } from './kitchen.js';

/** Codes of KeyboardEvent.code for each action (0-3 walk, 5 use). */
export const DEFAULT_BINDINGS = {
  0: ['ArrowUp', 'KeyW'], 1: ['ArrowDown', 'KeyS'], 2: ['ArrowRight', 'KeyD'], 3: ['ArrowLeft', 'KeyA'], 5: ['Space', 'KeyE', 'Enter'],
};

/** The keys held down: the last one pressed wins; use is never held. Each change gives {held, tap} to send. */
export class Keys {
  constructor(bindings = DEFAULT_BINDINGS) {
    this.pressed = []; // [code, action], oldest first
    this.bind(bindings);
  }

  bind(bindings) {
    this.actionOf = new Map();
    for (const [action, codes] of Object.entries(bindings)) for (const code of codes) this.actionOf.set(code, Number(action));
    this.pressed = [];
  }

  knows(code) {
    return this.actionOf.has(code);
  }

  get held() {
    return this.pressed.findLast(([, action]) => action !== INTERACT)?.[1] ?? null;
  }

  /** {held, tap} of a fresh press; null for a key that means nothing or is down already. */
  press(code, action = this.actionOf.get(code)) {
    if (action === undefined || this.pressed.some(([each]) => each === code)) return null;
    this.pressed.push([code, action]);
    return { held: this.held, tap: action };
  }

  /** {held, tap: null} if the release changed what is held; null if not. */
  release(code) {
    const before = this.held;
    const count = this.pressed.length;
    this.pressed = this.pressed.filter(([each]) => each !== code);
    return this.pressed.length !== count && this.held !== before ? { held: this.held, tap: null } : null;
  }

  /** Lets all keys go. {held: null, tap: null} if one was held; null if not. */
  clear() {
    const before = this.held;
    this.pressed = [];
    return before === null ? null : { held: null, tap: null };
  }
}

/** Lets changes out at the pace of the game, so that nobody who hammers on the keys sends more than the server bears. What
 * a timestep cannot use waits for the next: what is held, the last press to walk and the last to use, as the server keeps them. */
export class Pace {
  /** `send({held, tap})` is called at most `most` times at once, and `perTick` times a timestep. */
  constructor(send, most = 20, perTick = 3) {
    Object.assign(this, { send, most, perTick, left: most, waiting: null });
  }

  change({ held, tap }) {
    if (!this.waiting && this.left > 0) {
      this.left -= 1;
      this.send({ held, tap });
      return;
    }
    const others = (this.waiting?.taps ?? []).filter((each) => tap === null || (each === INTERACT) !== (tap === INTERACT));
    this.waiting = { held, taps: tap === null ? others : [...others, tap] };
  }

  /** A timestep was made. */
  tick() {
    this.left = Math.min(this.most, this.left + this.perTick);
    const waiting = this.waiting;
    this.clear();
    if (waiting) for (const tap of waiting.taps.length ? waiting.taps : [null]) this.change({ held: waiting.held, tap });
  }

  /** Forgets what waits; whether anything did. */
  clear() {
    const waited = this.waiting !== null;
    this.waiting = null;
    return waited;
  }
}

/** Listens to the keyboard. `hasFocus()`: whether keys belong to the game now (only then the page is kept from scrolling);
 * `changed({held, tap})` is told every change. */
export function listen(keys, hasFocus, changed) {
  const tell = (change) => { if (change) changed(change); };
  document.addEventListener('keydown', (event) => {
    if (!hasFocus() || event.ctrlKey || event.metaKey || event.altKey || !keys.knows(event.code)) return;
    event.preventDefault();
    if (!event.repeat) tell(keys.press(event.code));
  });
  document.addEventListener('keyup', (event) => {
    if (keys.knows(event.code)) tell(keys.release(event.code));
  });
}

/** Tells when the participant leaves the page and comes back: `left('hidden' | 'blur')`, `back()`. */
export function watchPresence(left, back) {
  window.addEventListener('blur', () => left(document.hidden ? 'hidden' : 'blur'));
  window.addEventListener('focus', () => { if (!document.hidden) back(); });
  document.addEventListener('visibilitychange', () => (document.hidden ? left('hidden') : back()));
}
