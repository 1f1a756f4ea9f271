// Names of keys: which key an event means, what is printed on it, and which keys a participant may choose.

/** @import { Catalogue } from '../browser/texts.js' */

import { local, readJson } from '../browser/storage.js';

/** @typedef {Pick<KeyboardEvent, 'code' | 'key'>} KeyEvent */

const STORE = 'kitchenmind.layout';
/** @type {Record<string, string>} */
const SIGNS = { ArrowUp: '↑', ArrowDown: '↓', ArrowLeft: '←', ArrowRight: '→' };
/** @type {Record<string, string>} */
const PAD_SIGNS = { Add: '+', Subtract: '−', Multiply: '×', Divide: '÷', Decimal: '.', Comma: ',', Equal: '=' };

/** Browsers and systems keep shortcuts on these keys, and some never send their key-up. */
const MODIFIERS = new Set(['Alt', 'AltGraph', 'Control', 'Meta', 'OS', 'Super', 'Hyper', 'Fn', 'Symbol']);

/** Codes that reach the page on every system and that no browser uses itself: the only ones that can be chosen. */
const USABLE_CODES = [
  'Key[A-Z]',
  'Digit\\d',
  'Numpad(\\d|Add|Subtract|Multiply|Divide|Decimal|Comma|Equal|Enter)',
  'Arrow(Up|Down|Left|Right)',
  'Space|Enter|Backspace|Delete|Insert|Home|End|PageUp|PageDown|Minus|Equal|BracketLeft|BracketRight|Semicolon|Quote',
  'Backquote|Backslash|Comma|Period|Slash|IntlBackslash|IntlRo|IntlYen',
];
const USABLE = new RegExp(`^(${USABLE_CODES.join('|')})$`);

/**
 * Names of `KeyboardEvent.key` from before the standard.
 * @type {Record<string, string>}
 */
const OLD_NAMES = {
  ...{ Up: 'ArrowUp', Down: 'ArrowDown', Left: 'ArrowLeft', Right: 'ArrowRight' },
  ...{ Spacebar: 'Space', ' ': 'Space', Del: 'Delete' },
};

/**
 * Whether a key with this code may be chosen for the game.
 * @param {unknown} code
 */
export function isUsable(code) {
  return USABLE.test(String(code));
}

/**
 * Whether the event is about a key such as Ctrl, Alt or Cmd.
 * @param {KeyEvent} event
 */
export function isModifier(event) {
  return MODIFIERS.has(event.key) || /^(Alt|Control|Meta|OS)(Left|Right)?$/.test(event.code);
}

/**
 * Return the key's code. Some phone keyboards send none: then the code that the character has on most keyboards, or ''.
 * @param {KeyEvent} event
 */
export function codeOf(event) {
  if (event.code && event.code !== 'Unidentified') return event.code;
  const key = event.key ?? '';
  if (/^[a-z]$/i.test(key)) return `Key${key.toUpperCase()}`;
  if (/^\d$/.test(key)) return `Digit${key}`;
  const named = OLD_NAMES[key] ?? key;
  return isUsable(named) ? named : '';
}

/** The labels on the keys of this keyboard, as far as they are known. */
export class KeyboardLayout {
  /** @param {() => void} changed is called when a key turns out to have another print */
  constructor(changed = () => {}) {
    this.changed = changed;
    /** @type {Map<string, string>} */
    this.prints = new Map(Object.entries(readJson(local, STORE, {})));
  }

  /**
   * Return the print of a code, or null.
   * @param {string} code
   */
  of(code) {
    return this.prints.get(code) ?? null;
  }

  /** Read them from the browser; only some browsers provide them. */
  async ask() {
    try {
      // Not in TypeScript's own types: https://wicg.github.io/keyboard-map/
      const { keyboard } = /** @type {{ keyboard?: { getLayoutMap?(): Promise<Map<string, string>> } }} */ (navigator);
      const map = await keyboard?.getLayoutMap?.();
      if (map) this.#add(map);
    } catch {
      // The browser does not say: key presses will.
    }
  }

  /**
   * Learn from a key press what the key writes.
   * @param {KeyboardEvent} event
   */
  learn(event) {
    if (!event.code || event.ctrlKey || event.metaKey || event.altKey || event.shiftKey || event.isComposing) return;
    if (event.getModifierState?.('AltGraph')) return; // the third sign of the key: on Linux no other flag shows it
    this.#add([[event.code, event.key]]);
  }

  /** @param {Iterable<[string, string]>} found */
  #add(found) {
    let isNew = false;
    for (const [code, key] of found) {
      const print = printOf(code, key);
      if (print === null || this.prints.get(code) === print) continue;
      this.prints.set(code, print);
      isNew = true;
    }
    if (!isNew) return;
    local.setItem(STORE, JSON.stringify(Object.fromEntries(this.prints)));
    this.changed();
  }
}

/**
 * Return the capital that a key with one character writes; null for keys that are called by their name.
 * @param {string} code
 * @param {string} key
 */
function printOf(code, key) {
  const character = String(key);
  if (!isUsable(code) || /^(Numpad|Space|Arrow)/.test(code)) return null;
  if ([...character].length !== 1 || !character.trim()) return null;
  const capital = character.toUpperCase();
  return [...capital].length === 1 ? capital : character;
}

/**
 * Return what a key cap shows for a code.
 * @param {string} code
 * @param {Catalogue} text
 * @param {KeyboardLayout | null} layout
 */
export function keyName(code, text, layout = null) {
  if (SIGNS[code]) return SIGNS[code];
  if (code === 'Space') return text('keys.space');
  if (code.startsWith('Numpad')) {
    const rest = code.slice('Numpad'.length);
    return text('keys.numpad', { key: PAD_SIGNS[rest] ?? rest });
  }
  return layout?.of(code) ?? code.replace(/^(Key|Digit)/, '');
}
