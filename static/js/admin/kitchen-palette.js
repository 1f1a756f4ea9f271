// The palette of the kitchen editor: one tile is chosen, by pointer or by arrow keys.

import { find, findAll } from '../browser/dom.js';
import { TILES } from './kitchen-grid.js';

export const FIRST_TILE = 'X';
/** @type {Record<string, number>} */
export const ARROWS = { ArrowUp: 0, ArrowDown: 1, ArrowRight: 2, ArrowLeft: 3 };

/**
 * Choose the first tile, then what the researcher chooses.
 * @param {(tile: string) => void} onChoice
 */
export function listenToPalette(onChoice) {
  let tile = FIRST_TILE;
  /** @param {string} chosen */
  const choose = (chosen) => {
    tile = chosen;
    onChoice(chosen);
    for (const button of findAll('#palette button', HTMLElement)) {
      const isChosen = button.dataset.tile === chosen;
      button.setAttribute('aria-checked', String(isChosen));
      button.tabIndex = isChosen ? 0 : -1;
    }
  };
  for (const button of findAll('#palette button', HTMLElement)) {
    button.addEventListener('click', () => choose(button.dataset.tile ?? 'X'));
  }
  find('#palette', HTMLElement).addEventListener('keydown', (event) => {
    if (!(event.key in ARROWS)) return;
    event.preventDefault();
    const step = event.key === 'ArrowRight' || event.key === 'ArrowDown' ? 1 : TILES.length - 1;
    choose(TILES[(TILES.indexOf(tile) + step) % TILES.length]);
    find('#palette [aria-checked=true]', HTMLElement).focus();
  });
  choose(tile);
}
