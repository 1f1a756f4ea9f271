// Other keys for the participant: a small dialog; the choice stays in this browser.

import { DEFAULT_BINDINGS } from './input.js';

const STORE = 'kitchenmind.keys';
const ARROWS = { ArrowUp: '↑', ArrowDown: '↓', ArrowLeft: '←', ArrowRight: '→' };

/** The stored keys, or the usual ones. */
export function storedBindings(storage = localStorage) {
  try {
    const stored = JSON.parse(storage.getItem(STORE));
    const whole = Object.keys(DEFAULT_BINDINGS).every((action) => Array.isArray(stored[action]) && stored[action].length);
    return whole ? stored : DEFAULT_BINDINGS;
  } catch {
    return DEFAULT_BINDINGS;
  }
}

/** What is written on a key cap for a KeyboardEvent.code. */
export function keyName(code, text) {
  return ARROWS[code] ?? (code === 'Space' ? text('keys.space') : code.replace(/^(Key|Digit|Numpad)/, ''));
}

/** The bindings with `code` as first key of `action`; no key means two things. */
export function rebind(bindings, action, code) {
  const free = Object.entries(bindings).map(([each, codes]) => [each, codes.filter((other) => other !== code)]);
  const next = Object.fromEntries(free);
  next[action] = [code];
  for (const each of Object.keys(next)) if (!next[each].length) next[each] = bindings[action].filter((other) => other !== code).slice(0, 1);
  return Object.values(next).every((codes) => codes.length) ? next : bindings;
}

/** Opens on `opener`; `changed(bindings)` is told a new choice. */
export function keysDialog(dialog, opener, text, changed) {
  let bindings = storedBindings();
  let asking = null; // the button that waits for a key
  const buttons = [...dialog.querySelectorAll('[data-rebind]')];
  const show = () => buttons.forEach((button) => {
    const names = bindings[button.dataset.rebind].map((code) => keyName(code, text)).join(' / ');
    button.textContent = button === asking ? text('keys.press') : names;
  });
  const keep = (next) => {
    bindings = next;
    localStorage.setItem(STORE, JSON.stringify(next));
    changed(next);
    show();
  };
  opener.addEventListener('click', () => { asking = null; show(); dialog.showModal(); });
  buttons.forEach((button) => button.addEventListener('click', () => { asking = asking === button ? null : button; show(); }));
  dialog.querySelector('#keys-reset').addEventListener('click', () => keep(DEFAULT_BINDINGS));
  dialog.addEventListener('keydown', (event) => {
    if (!asking || event.code === 'Tab') return;
    event.preventDefault();
    const { rebind: action } = asking.dataset;
    asking = null;
    dialog.addEventListener('keyup', (release) => release.preventDefault(), { once: true }); // or Space would press the button again
    if (event.code === 'Escape') show();
    else keep(rebind(bindings, action, event.code));
  });
}
