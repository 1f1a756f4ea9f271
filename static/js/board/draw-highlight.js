// The frame around the cell that the tutorial points at.

/** @import { Cell } from './kitchen.js' */

import { CELL } from './background.js';
import { colour } from './sprites.js';

/**
 * Draw a slowly pulsing frame around a cell; it does not move with reduced motion.
 * @type {(context: CanvasRenderingContext2D, cell: Cell, now: number, reduced: boolean) => void}
 */
export function drawHighlight(context, [x, y], now, reduced) {
  const beat = reduced ? 0 : 1.5 * Math.sin(now / 260);
  for (const [paint, width] of /** @type {const} */ ([
    ['#ffffff', 7],
    [colour('--accent'), 4],
  ])) {
    context.strokeStyle = paint;
    context.lineWidth = width;
    rounded(context, x * CELL + 4.5 - beat, y * CELL + 3.5 - beat, CELL - 9 + 2 * beat, CELL - 7 + 2 * beat);
    context.stroke();
  }
}

/**
 * Trace a rectangle with round corners. `roundRect` is missing in browsers of 2022.
 * @type {(context: CanvasRenderingContext2D, left: number, top: number, width: number, height: number) => void}
 */
function rounded(context, left, top, width, height) {
  const corners = [
    [left + width, top],
    [left + width, top + height],
    [left, top + height],
    [left, top],
  ];
  context.beginPath();
  context.moveTo(left + width / 2, top);
  corners.forEach(([x, y], k) => {
    const [nextX, nextY] = corners[(k + 1) % 4];
    context.arcTo(x, y, (x + nextX) / 2, (y + nextY) / 2, 12);
  });
  context.closePath();
}
