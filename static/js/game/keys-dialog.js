// Other keys for the participant: a small dialog; the choice stays in this browser.

import { DEFAULT_BINDINGS } from './input.js';
import { codeOf, isModifier, isUsable, keyName } from './key-names.js';
import { local, readJson } from '../browser/storage.js';

const STORE = 'kitchenmind.keys';

/** The stored keys, or the usual ones. Keys that do not work are left out; an action without any gets its usual ones. */
export function storedBindings(storage = local) {
  const stored = readJson(storage, STORE, {});
  const own = Object.keys(DEFAULT_BINDINGS).map((action) => [action, Array.isArray(stored[action]) ? stored[action].filter(isUsable) : []]);
  const taken = own.flatMap(([, codes]) => codes);
  const next = own.map(([action, codes]) => [action, codes.length ? codes : DEFAULT_BINDINGS[action].filter((code) => !taken.includes(code))]);
  return next.every(([, codes]) => codes.length) ? Object.fromEntries(next) : DEFAULT_BINDINGS;
}

/** The bindings with `code` as first key of `action`; no key means two things. */
export function rebind(bindings, action, code) {
  const free = Object.entries(bindings).map(([each, codes]) => [each, codes.filter((other) => other !== code)]);
  const next = Object.fromEntries(free);
  next[action] = [code];
  for (const each of Object.keys(next)) if (!next[each].length) next[each] = bindings[action].filter((other) => other !== code).slice(0, 1);
  return Object.values(next).every((codes) => codes.length) ? next : bindings;
}

/** Opens on `opener`; `changed(bindings)` is told a new choice. `layout`: what is printed on the keys. Returns `show()`, for
 * when that has become known. */
export function keysDialog(dialog, opener, text, layout, changed) {
  let bindings = storedBindings();
  let asking = null; // the button that waits for a key
  const buttons = [...dialog.querySelectorAll('[data-rebind]')];
  const note = dialog.querySelector('#keys-note');
  const show = (words = '') => {
    note.textContent = words;
    buttons.forEach((button) => {
      const names = bindings[button.dataset.rebind].map((code) => keyName(code, text, layout)).join(' / ');
      button.textContent = button === asking ? text('keys.press') : names;
    });
  };
  const keep = (next) => {
    bindings = next;
    local.setItem(STORE, JSON.stringify(next));
    changed(next);
    show();
  };
  opener.addEventListener('click', () => { asking = null; show(); dialog.showModal(); });
  buttons.forEach((button) => button.addEventListener('click', () => { asking = asking === button ? null : button; show(); }));
  dialog.querySelector('#keys-reset').addEventListener('click', () => { asking = null; keep(DEFAULT_BINDINGS); });
  dialog.addEventListener('keydown', (event) => {
    const code = codeOf(event);
    if (!asking || code === 'Tab') return;
    event.preventDefault();
    if (event.repeat) return;
    const isFree = !event.ctrlKey && !event.metaKey && !event.altKey && !isModifier(event);
    if (event.key !== 'Escape' && !(isFree && isUsable(code))) { show(text('keys.unusable')); return; }
    const { rebind: action } = asking.dataset;
    asking = null;
    dialog.addEventListener('keyup', (release) => release.preventDefault(), { once: true }); // or Space would press the button again
    if (event.key === 'Escape') show();
    else keep(rebind(bindings, action, code));
  });
  return () => show(note.textContent);
}
