// Below a field that names a kitchen or an agent: what can be named there, each with a button. The browser's own list
// of such a field shows only names like the one that it has already; of a new item's name, none.

import { drawButton, isKitchen } from './builder-kitchens.js';
import { make } from './elements.js';

/** @typedef {(string | number)[]} Path */
/** @typedef {{ kitchens: string[], agents: string[] }} Offers kitchens that were drawn here, and bundled agents */

/**
 * @param {Path} path
 * @param {Offers} offers
 * @param {(name: string) => void} choose
 */
export function offersOf(path, { kitchens, agents }, choose) {
  if (path.at(-1) !== 'name') return null;
  if (isKitchen(path.slice(0, -1))) return buttonsOf(path, 'Drawn here', kitchens, choose);
  return path[0] === 'agents' && path.length === 3 ? buttonsOf(path, 'Bundled', agents, choose) : null;
}

/**
 * @param {Path} path
 * @param {string} words
 * @param {string[]} names
 * @param {(name: string) => void} choose
 */
function buttonsOf(path, words, names, choose) {
  if (names.length === 0) return null;
  const buttons = names.map((name) => drawButton(name, `choose ${name} ${JSON.stringify(path)}`, () => choose(name)));
  const place = make('div', { className: 'own-models', role: 'group' });
  place.setAttribute('aria-label', words);
  place.append(make('span', { className: 'soft small', text: `${words}: ` }), ...buttons);
  return place;
}
