// Strokes of a pointer on the drawing of a kitchen: from where it goes down to where it is lifted, cell by cell.

/** @import { Cell } from '../board/kitchen.js' */

import { between } from './kitchen-grid.js';

/**
 * @param {HTMLElement} surface
 * @param {(event: PointerEvent) => Cell} cellAt
 * @param {{ begin(): void, draw(cells: Cell[], last: Cell): void, end(): void }} on `last`: where the pointer is now
 */
export function listenToStrokes(surface, cellAt, on) {
  /** @type {Cell | null} where the pointer was that draws */
  let pen = null;
  surface.addEventListener('pointerdown', (event) => {
    if (event.button !== 0 || pen) return;
    surface.setPointerCapture(event.pointerId);
    pen = cellAt(event);
    on.begin();
    on.draw([pen], pen);
  });
  surface.addEventListener('pointermove', (event) => {
    if (!pen) return;
    const cell = cellAt(event);
    const cells = between(pen, cell);
    pen = cell;
    on.draw(cells, cell);
  });
  const end = () => {
    if (!pen) return;
    pen = null;
    on.end();
  };
  surface.addEventListener('pointerup', end);
  surface.addEventListener('pointercancel', end);
}
