// The key caps on the game page: in the list of keys and in the tutorial's texts.

/** @import { Catalogue } from '../browser/texts.js' */
/** @import { Bindings } from './input.js' */
/** @import { KeyboardLayout } from './key-names.js' */

import { findAll } from '../browser/dom.js';
import { keyName } from './key-names.js';

/**
 * Return the elements for {walk}, {use} and {marks} in the page's texts.
 * @param {Bindings} bindings
 * @param {Catalogue} text
 * @param {KeyboardLayout} layout
 */
export function keyCaps(bindings, text, layout) {
  /** @param {string} words */
  const cap = (words) => Object.assign(document.createElement('kbd'), { textContent: words });
  /** @param {number} action */
  const name = (action) => keyName(bindings[action][0], text, layout);
  const walk = document.createElement('span');
  walk.className = 'capline';
  walk.append(...[3, 0, 1, 2].map((action) => cap(name(action))));
  const touch = matchMedia('(pointer: coarse)').matches;
  return { walk, use: cap(touch ? text('keys.use') : name(5)), marks: cap(touch ? text('keys.marks') : name(6)) };
}

/**
 * Write the names of the keys on the page.
 * @param {HTMLElement} page
 * @param {Bindings} bindings
 * @param {Catalogue} text
 * @param {KeyboardLayout} layout
 */
export function showKeyCaps(page, bindings, text, layout) {
  for (const cap of findAll('kbd[data-action]', HTMLElement, page)) {
    cap.textContent = keyName(bindings[Number(cap.dataset.action)][0], text, layout);
  }
}
