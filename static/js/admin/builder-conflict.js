// Two people have changed the same part of a draft: shows it as both wrote it, and lets the second choose or merge.

import { find } from '../browser/dom.js';
import { make } from './elements.js';

/** @typedef {import('./builder-saving.js').Theirs} Theirs */
/** @typedef {import('./builder-saving.js').Contradiction} Contradiction */

const LINES_BEFORE = 2; // of what both have, to find the place
const MAX_LINES = 14; // of a field

/**
 * Ask what to do. The answer is the text to continue with.
 * @param {Theirs} theirs
 * @param {string} mine
 * @returns {Promise<string>}
 */
export function askForText(theirs, mine) {
  const dialog = find('#conflict', HTMLDialogElement);
  const parts = theirs.parts ?? [{ theirs: theirs.text, mine }];
  const fields = parts.map((part, index) => (typeof part === 'string' ? part : field(part, parts[index - 1])));
  const places = fields.filter((one) => typeof one !== 'string');
  const count = places.length === 1 ? 'the same place' : `the same ${places.length} places`;
  find('#conflict-words', HTMLElement).textContent =
    `${theirs.author} has saved revision ${theirs.revision}. You both changed ${count}. ` +
    'All other changes are kept.';
  find('#conflict-places', HTMLElement).replaceChildren(...places.map((one) => one.place));
  dialog.oncancel = (event) => event.preventDefault(); // Escape would leave the choice open
  if (!dialog.open) dialog.showModal();
  return new Promise((chosen) => {
    /** @param {string} text */
    const end = (text) => {
      dialog.close();
      chosen(text);
    };
    find('#take-theirs', HTMLButtonElement).onclick = () => end(theirs.text);
    find('#take-mine', HTMLButtonElement).onclick = () => end(fields.map(textOf).join(''));
  });
}

/** @param {string | { text(): string }} field */
function textOf(field) {
  return typeof field === 'string' ? field : field.text();
}

/**
 * One place: theirs on the left, on the right what will be saved.
 * @param {Contradiction} part
 * @param {string | Contradiction | undefined} before
 */
function field(part, before) {
  const left = make('textarea', { className: 'theirs', readonly: '', wrap: 'off', spellcheck: 'false' });
  const right = make('textarea', { className: 'mine', wrap: 'off', spellcheck: 'false' });
  left.value = part.theirs;
  right.value = part.mine;
  const lines = Math.max(...[part.theirs, part.mine].map((text) => text.split('\n').length));
  for (const area of [left, right]) area.rows = Math.min(MAX_LINES, Math.max(2, lines));
  left.onscroll = () => right.scrollTo(left.scrollLeft, left.scrollTop);
  const take = make('button', { className: 'btn tiny', type: 'button' }, 'Take theirs here');
  take.onclick = () => {
    right.value = part.theirs;
    right.focus();
  };
  const known = typeof before === 'string' ? before.trimEnd().split('\n').slice(-LINES_BEFORE).join('\n') : '';
  const place = make(
    'div',
    { className: 'conflict-place' },
    make('pre', { className: 'soft small', text: known ? `…\n${known}` : '' }),
    make(
      'div',
      { className: 'both' },
      make('label', {}, 'Theirs, as it is saved', left),
      make('label', {}, 'What is saved: yours, to be edited', right),
    ),
    take,
  );
  // A last line without its end would run into the next part.
  const isWhole = part.mine.endsWith('\n') || part.mine === '';
  const text = () => (isWhole && right.value && !right.value.endsWith('\n') ? `${right.value}\n` : right.value);
  return { place, text };
}
