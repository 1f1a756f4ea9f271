// Names of keys: which key an event means, what is printed on it, and which keys a participant may choose.

import { local, readJson } from '../browser/storage.js';

const STORE = 'kitchenmind.layout';
const SIGNS = { ArrowUp: '↑', ArrowDown: '↓', ArrowLeft: '←', ArrowRight: '→' };
const PAD_SIGNS = { Add: '+', Subtract: '−', Multiply: '×', Divide: '÷', Decimal: '.', Comma: ',', Equal: '=' };

/** Keys that hold another key's meaning. Browsers and systems keep shortcuts on them, and some never send their key-up. */
const MODIFIERS = new Set(['Alt', 'AltGraph', 'Control', 'Meta', 'OS', 'Super', 'Hyper', 'Fn', 'Symbol']);

/** Codes that reach the page on every system, go down and up, and belong to no browser: the only ones to be chosen. */
const USABLE = new RegExp(`^(${[
  'Key[A-Z]', 'Digit\\d', 'Numpad(\\d|Add|Subtract|Multiply|Divide|Decimal|Comma|Equal|Enter)', 'Arrow(Up|Down|Left|Right)',
  'Space|Enter|Backspace|Delete|Insert|Home|End|PageUp|PageDown|Minus|Equal|BracketLeft|BracketRight|Semicolon|Quote',
  'Backquote|Backslash|Comma|Period|Slash|IntlBackslash|IntlRo|IntlYen',
].join('|')})$`);

/** Names of `KeyboardEvent.key` from a time before the standard. */
const OLD_NAMES = { Up: 'ArrowUp', Down: 'ArrowDown', Left: 'ArrowLeft', Right: 'ArrowRight', Spacebar: 'Space', ' ': 'Space', Del: 'Delete' };

/** Whether a key with this code may be chosen for the game. */
export function isUsable(code) {
  return USABLE.test(code);
}

/** Whether the event is about a key such as Ctrl, Alt or Cmd. */
export function isModifier(event) {
  return MODIFIERS.has(event.key) || /^(Alt|Control|Meta|OS)(Left|Right)?$/.test(event.code);
}

/** The key's code. Some phone keyboards send none: then the code that the character has on most keyboards; '' if there is
 * no telling. */
export function codeOf(event) {
  if (event.code && event.code !== 'Unidentified') return event.code;
  const key = event.key ?? '';
  if (/^[a-z]$/i.test(key)) return `Key${key.toUpperCase()}`;
  if (/^\d$/.test(key)) return `Digit${key}`;
  const named = OLD_NAMES[key] ?? key;
  return isUsable(named) ? named : '';
}

/** What is printed on the keys of this keyboard, as far as it is known. */
export class Layout {
  /** `changed()` is called when a key turns out to have another print. */
  constructor(changed = () => {}) {
    this.changed = changed;
    this.prints = new Map(Object.entries(readJson(local, STORE, {})));
  }

  /** The print of a code, or null. */
  of(code) {
    return this.prints.get(code) ?? null;
  }

  /** Asks the browser, where it tells. */
  async ask() {
    try {
      const map = await navigator.keyboard?.getLayoutMap?.();
      if (map) this.#take(map);
    } catch {
      // The browser keeps it to itself: key presses tell.
    }
  }

  /** Learns from a key press what the key writes. */
  learn(event) {
    if (!event.code || event.ctrlKey || event.metaKey || event.altKey || event.shiftKey || event.isComposing) return;
    if (event.getModifierState?.('AltGraph')) return; // the third sign of the key: on Linux no other flag tells
    this.#take([[event.code, event.key]]);
  }

  #take(found) {
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

/** The capital that a key with one character writes; null for keys that are called by their name. */
function printOf(code, key) {
  if (!isUsable(code) || /^(Numpad|Space|Arrow)/.test(code) || [...String(key)].length !== 1 || !String(key).trim()) return null;
  const capital = key.toUpperCase();
  return [...capital].length === 1 ? capital : key;
}

/** What is written on a key cap for a code. `text`: the page's words; `layout`: this keyboard's prints. */
export function keyName(code, text, layout = null) {
  if (SIGNS[code]) return SIGNS[code];
  if (code === 'Space') return text('keys.space');
  if (code.startsWith('Numpad')) {
    const rest = code.slice('Numpad'.length);
    return text('keys.numpad', { key: PAD_SIGNS[rest] ?? rest });
  }
  return layout?.of(code) ?? code.replace(/^(Key|Digit)/, '');
}
