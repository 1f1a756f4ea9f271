// Two people have changed a draft: shows both texts, and lets the one who comes second choose or merge.

import { find } from '../browser/dom.js';

/** @typedef {import('./builder-saving.js').Theirs} Theirs */

/**
 * Ask what to do. The answer is the text to continue with.
 * @param {Theirs} theirs
 * @param {string} mine
 * @returns {Promise<string>}
 */
export function askForText(theirs, mine) {
  const dialog = find('#conflict', HTMLDialogElement);
  const [left, right] = [find('#theirs', HTMLTextAreaElement), find('#mine', HTMLTextAreaElement)];
  left.value = theirs.text;
  right.value = mine;
  const when = `${theirs.author} has saved revision ${theirs.revision}. Your changes are based on an earlier one.`;
  find('#conflict-words', HTMLElement).textContent = when;
  find('#conflict-difference', HTMLElement).textContent = differences(theirs.text, mine);
  left.onscroll = () => right.scrollTo(left.scrollLeft, left.scrollTop);
  dialog.oncancel = (event) => event.preventDefault(); // Escape would leave the choice open
  if (!dialog.open) dialog.showModal();
  return new Promise((chosen) => {
    /** @param {string} text */
    const end = (text) => {
      dialog.close();
      chosen(text);
    };
    find('#take-theirs', HTMLButtonElement).onclick = () => end(left.value);
    find('#take-mine', HTMLButtonElement).onclick = () => end(right.value);
  });
}

/**
 * @param {string} theirs
 * @param {string} mine
 */
function differences(theirs, mine) {
  const [left, right] = [theirs.split('\n'), mine.split('\n')];
  const lines = [];
  for (let index = 0; index < Math.max(left.length, right.length); index++) {
    if (left[index] !== right[index]) lines.push(index + 1);
  }
  const some = lines.slice(0, 12).join(', ');
  return `Lines that differ: ${some}${lines.length > 12 ? ` and ${lines.length - 12} more` : ''}.`;
}
