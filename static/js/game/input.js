// Keys -> what the chef shall do. `Keys` is plain logic (no DOM); `listen` ties it to the keyboard of a page.

import { codeOf, isModifier } from './key-names.js';
import { INTERACT } from '../board/kitchen.js';

/** Codes of KeyboardEvent.code for each action (0-3 walk, 5 use). */
export const DEFAULT_BINDINGS = {
  0: ['ArrowUp', 'KeyW'], 1: ['ArrowDown', 'KeyS'], 2: ['ArrowRight', 'KeyD'], 3: ['ArrowLeft', 'KeyA'], 5: ['Space', 'KeyE', 'Enter'],
};

/** Keys of the number pad do what their namesakes do, unless they are bound to something else. */
const NAMESAKES = { Numpad8: 'ArrowUp', Numpad2: 'ArrowDown', Numpad6: 'ArrowRight', Numpad4: 'ArrowLeft', NumpadEnter: 'Enter' };

const WATCH_MS = 250;
const LEAST_SILENCE_MS = 1000; // a key that repeated and is silent longer has been let go
const GAPS = 4; // ... or longer than so many of its own repeats

/** The keys held down: the last one pressed wins; use is never held. Each change gives {held, tap} to send. */
export class Keys {
  constructor(bindings = DEFAULT_BINDINGS) {
    this.pressed = []; // [code, action], oldest first
    this.doubted = new Map(); // code -> action: were down when it became unsure whether they still are
    this.bind(bindings);
  }

  bind(bindings) {
    this.actionOf = new Map();
    for (const [action, codes] of Object.entries(bindings)) for (const code of codes) this.actionOf.set(code, Number(action));
    for (const [code, namesake] of Object.entries(NAMESAKES)) {
      if (!this.actionOf.has(code) && this.actionOf.has(namesake)) this.actionOf.set(code, this.actionOf.get(namesake));
    }
    this.pressed = [];
    this.doubted.clear();
  }

  knows(code) {
    return this.actionOf.has(code);
  }

  isDown(code) {
    return this.pressed.some(([each]) => each === code);
  }

  get held() {
    const walking = this.pressed.filter(([, action]) => action !== INTERACT);
    return walking.length ? walking[walking.length - 1][1] : null;
  }

  /** {held, tap} of a fresh press; null for a key that means nothing or is down already. */
  press(code, action = this.actionOf.get(code)) {
    if (action === undefined || this.isDown(code)) return null;
    this.doubted.delete(code);
    this.pressed.push([code, action]);
    return { held: this.held, tap: action };
  }

  /** {held, tap: null} if the release changed what is held; null if not. */
  release(code) {
    this.doubted.delete(code);
    return this.#drop([code]);
  }

  /** Lets these keys go because their key-up may have been lost. The change to send, or null. */
  doubt(codes) {
    for (const [code, action] of this.pressed) if (codes.includes(code)) this.doubted.set(code, action);
    return this.#drop(codes);
  }

  /** A repeat shows that a doubted key is still down: it is held again, without a tap. The change to send, or null. */
  resume(code) {
    const action = this.doubted.get(code);
    if (action === undefined) return null;
    this.doubted.delete(code);
    const before = this.held;
    this.pressed.push([code, action]);
    return this.held === before ? null : { held: this.held, tap: null };
  }

  /** Lets all keys go. {held: null, tap: null} if one was held; null if not. */
  clear() {
    const before = this.held;
    this.pressed = [];
    this.doubted.clear();
    return before === null ? null : { held: null, tap: null };
  }

  #drop(codes) {
    const before = this.held;
    this.pressed = this.pressed.filter(([each]) => !codes.includes(each));
    return this.held === before ? null : { held: this.held, tap: null };
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
 * `changed({held, tap})` is told every change. No key stays down only because its key-up never came: keys are let go when
 * a modifier, a menu, a drag or a dialog may swallow it, when their repeats stop, and when another press of the same key shows that it did. */
export function listen(keys, hasFocus, changed) {
  const beats = new Heartbeat();
  const nameless = new Set(); // pressed keys of a keyboard that sends no codes
  const isNameless = ({ code }) => !code || code === 'Unidentified';
  const tell = (change) => { if (change) changed(change); };
  const doubt = (codes = [...keys.actionOf.keys()]) => tell(keys.doubt(codes));
  document.addEventListener('keydown', (event) => {
    if (isModifier(event)) doubt();
    const code = codeOf(event);
    if (!event.repeat) beats.pressed(code);
    if (!hasFocus() || event.ctrlKey || event.metaKey || event.altKey || !keys.knows(code)) return;
    event.preventDefault();
    if (event.repeat) {
      beats.repeated(code);
      tell(keys.resume(code));
      return;
    }
    if (isNameless(event)) nameless.add(code);
    keys.release(code); // down already: its key-up was lost
    tell(keys.press(code));
  });
  document.addEventListener('keyup', (event) => {
    if (isModifier(event)) doubt();
    const codes = isNameless(event) ? [...nameless] : [codeOf(event)];
    for (const code of codes) {
      beats.released(code);
      nameless.delete(code);
      if (keys.knows(code)) tell(keys.release(code));
    }
  });
  for (const kind of ['contextmenu', 'beforeprint', 'dragstart']) window.addEventListener(kind, () => doubt());
  setInterval(() => {
    if (!hasFocus() || !document.hasFocus()) doubt(); // a dialog, however it was opened
    if (!beats.isSilent) return;
    doubt([beats.code]);
    beats.pressed(beats.code);
  }, WATCH_MS);
}

/** The repeats of the key pressed last. Only that one repeats, and not on every keyboard: a key that never did is believed. */
class Heartbeat {
  constructor() {
    this.pressed('');
  }

  pressed(code) {
    Object.assign(this, { code, last: performance.now(), count: 0, gap: 0 });
  }

  repeated(code) {
    if (code !== this.code) return;
    const now = performance.now();
    if (this.count > 0) this.gap = Math.max(this.gap, now - this.last);
    this.count += 1;
    this.last = now;
  }

  released(code) {
    if (code === this.code) this.pressed('');
  }

  /** Whether the key repeated and has stopped. */
  get isSilent() {
    return this.count > 1 && performance.now() - this.last > Math.max(LEAST_SILENCE_MS, GAPS * this.gap);
  }
}

/** Tells when the participant leaves the page and comes back: `left('hidden' | 'blur')`, `back()`. */
export function watchPresence(left, back) {
  window.addEventListener('blur', () => left(document.hidden ? 'hidden' : 'blur'));
  window.addEventListener('focus', () => { if (!document.hidden) back(); });
  document.addEventListener('visibilitychange', () => (document.hidden ? left('hidden') : back()));
}
