// Turns keys into what the chef does. Pure logic: keyboard.js and touch.js call it.

import { INTERACT } from '../board/kitchen.js';

/** @typedef {Record<string, string[]>} Bindings action -> codes of KeyboardEvent.code */
/** @typedef {{ held: number | null, tap: number | null, marks?: boolean }} Change what to send: see Wire.Input */

/** The key that asks for the marks, where a study shows them on demand: no action of the chef. */
export const MARKS = 6;

/**
 * 0 to 3 walk, 5 uses what is ahead, 6 asks for the marks.
 * @type {Bindings}
 */
export const DEFAULT_BINDINGS = {
  0: ['ArrowUp', 'KeyW'],
  1: ['ArrowDown', 'KeyS'],
  2: ['ArrowRight', 'KeyD'],
  3: ['ArrowLeft', 'KeyA'],
  5: ['Space', 'KeyE', 'Enter'],
  [MARKS]: ['KeyQ', 'KeyM'],
};

/** Keys of the number pad do what their namesakes do, unless they are bound to something else. */
const NAMESAKES = {
  ...{ Numpad8: 'ArrowUp', Numpad2: 'ArrowDown', Numpad6: 'ArrowRight', Numpad4: 'ArrowLeft' },
  NumpadEnter: 'Enter',
};

/** The keys held down. The last one pressed wins; use is never held. Each change gives {held, tap} to send. */
export class Keys {
  /** @param {Bindings} bindings */
  constructor(bindings = DEFAULT_BINDINGS) {
    /** @type {[code: string, action: number][]} oldest first */
    this.pressed = [];
    /** @type {Map<string, number>} code -> action: these were down when it became uncertain whether they still are */
    this.doubted = new Map();
    /** @type {Map<string, number>} */
    this.actionOf = new Map();
    /** Whether the key that asks for the marks has a meaning in this game. */
    this.marksOnDemand = false;
    this.bind(bindings);
  }

  /** @param {Bindings} bindings */
  bind(bindings) {
    const entries = Object.entries(bindings);
    this.actionOf = new Map(entries.flatMap(([action, codes]) => codes.map((code) => [code, Number(action)])));
    for (const [code, namesake] of Object.entries(NAMESAKES)) {
      const action = this.actionOf.get(namesake);
      if (!this.actionOf.has(code) && action !== undefined) this.actionOf.set(code, action);
    }
    this.pressed = [];
    this.doubted.clear();
  }

  /** @param {string} code */
  knows(code) {
    const action = this.actionOf.get(code);
    return action !== undefined && (action !== MARKS || this.marksOnDemand);
  }

  /** @param {string} code */
  isDown(code) {
    return this.pressed.some(([each]) => each === code);
  }

  get held() {
    const walking = this.pressed.filter(([, action]) => action !== INTERACT && action !== MARKS);
    return walking.length ? walking[walking.length - 1][1] : null;
  }

  /** Whether a key that asks for the marks is down. */
  get asks() {
    return this.pressed.some(([, action]) => action === MARKS);
  }

  /**
   * Return the change of a new press; null for a key that has no action or is already down.
   * @param {string} code
   * @param {number | undefined} action
   * @returns {Change | null}
   */
  press(code, action = this.actionOf.get(code)) {
    if (action === undefined || this.isDown(code) || (action === MARKS && !this.marksOnDemand)) return null;
    const before = this.#state();
    this.doubted.delete(code);
    this.pressed.push([code, action]);
    return action === MARKS ? this.#since(before) : { held: this.held, tap: action };
  }

  /**
   * Return the change if the release changed what is held, else null.
   * @param {string} code
   */
  release(code) {
    this.doubted.delete(code);
    return this.#drop([code]);
  }

  /**
   * Release these keys because their key-up may have been lost. Return the change to send, or null.
   * @param {string[]} codes
   */
  doubt(codes) {
    for (const [code, action] of this.pressed) if (codes.includes(code)) this.doubted.set(code, action);
    return this.#drop(codes);
  }

  /**
   * Hold a doubted key again, without a tap: a repeat shows that it is still down. Return the change to send, or
   * null.
   * @param {string} code
   * @returns {Change | null}
   */
  resume(code) {
    const action = this.doubted.get(code);
    if (action === undefined) return null;
    this.doubted.delete(code);
    const before = this.#state();
    this.pressed.push([code, action]);
    return this.#since(before);
  }

  /**
   * Release all keys. Return the change if one was held, else null.
   * @returns {Change | null}
   */
  clear() {
    const before = this.#state();
    this.pressed = [];
    this.doubted.clear();
    return this.#since(before);
  }

  /**
   * @param {string[]} codes
   * @returns {Change | null}
   */
  #drop(codes) {
    const before = this.#state();
    this.pressed = this.pressed.filter(([each]) => !codes.includes(each));
    return this.#since(before);
  }

  #state() {
    return { held: this.held, asks: this.asks };
  }

  /**
   * @param {{ held: number | null, asks: boolean }} before
   * @returns {Change | null}
   */
  #since(before) {
    const { held, asks } = this.#state();
    if (held === before.held && asks === before.asks) return null;
    return asks === before.asks ? { held, tap: null } : { held, tap: null, marks: asks };
  }
}

/**
 * Sends changes at the pace of the game, so that rapid key presses never exceed what the server accepts. Changes that
 * a timestep cannot use wait for the next one: what is held, the last press to walk and the last to use, as on the
 * server. For the marks key, the last press and its release are kept.
 */
export class InputPacer {
  /**
   * @param {(change: Change) => void} send
   * @param {number} most how many changes may be sent at once
   * @param {number} perTick how many a timestep
   */
  constructor(send, most = 20, perTick = 3) {
    this.send = send;
    this.most = most;
    this.perTick = perTick;
    this.left = most;
    /** @type {{ held: number | null, taps: number[], marks: boolean[] } | null} */
    this.waiting = null;
  }

  /** @param {Change} change */
  change({ held, tap, marks }) {
    if (!this.waiting && this.left > 0) {
      this.left -= 1;
      this.send(marks === undefined ? { held, tap } : { held, tap, marks });
      return;
    }
    const { taps, marks: asked } = this.waiting ?? { taps: [], marks: [] };
    const others = taps.filter((each) => tap === null || (each === INTERACT) !== (tap === INTERACT));
    this.waiting = {
      held,
      taps: tap === null ? others : [...others, tap],
      marks: marks === undefined ? asked : fewer([...asked, marks]),
    };
  }

  /** Call this when a timestep was made. */
  tick() {
    this.left = Math.min(this.most, this.left + this.perTick);
    const waiting = this.waiting;
    this.clear();
    if (!waiting) return;
    const { held, taps, marks } = waiting;
    for (const tap of taps) this.change({ held, tap });
    for (const asks of marks) this.change({ held, tap: null, marks: asks });
    if (!taps.length && !marks.length) this.change({ held, tap: null });
  }

  /** Forget what waits. Return whether anything did. */
  clear() {
    const waited = this.waiting !== null;
    this.waiting = null;
    return waited;
  }
}

/**
 * At most two presses of the key that asks for the marks, each with its release. Pairs of presses are left out, as they
 * toggle on and off again.
 * @param {boolean[]} marks
 */
function fewer(marks) {
  return marks.length > 4 ? marks.slice(4) : marks;
}

/**
 * Release all keys; return what to tell the server about it, or null.
 * @param {Keys} keys
 * @param {InputPacer} pacer
 * @returns {Change | null}
 */
export function releaseAll(keys, pacer) {
  const waited = pacer.clear();
  const none = keys.marksOnDemand ? { held: null, tap: null, marks: false } : { held: null, tap: null };
  return keys.clear() ?? (waited ? none : null);
}
