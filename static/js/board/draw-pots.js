// Pots on the board: which drawing a pot has, and the ring that shows how far it has cooked.

/** @import { Pot } from './kitchen.js' */

import { CELL } from './background.js';
import { COOK_TIME } from './kitchen.js';
import { colour } from './sprites.js';

const RING = { x: 51, y: 15, radius: 8.4, disc: 13.4, width: 5.6 }; // in 1/64 of a cell

/**
 * Return the name of a pot's sprite.
 * @param {Pot} pot
 */
export function potSprite([, , onions, cooking]) {
  if (cooking >= COOK_TIME) return 'pot-ready';
  if (cooking >= 0) return 'pot-cooking';
  return onions ? `pot-${onions}` : 'pot-empty';
}

/**
 * Draw how much of the cooking time is over, 0..1, at the corner of the pot in a cell.
 * @type {(context: CanvasRenderingContext2D, column: number, row: number, part: number) => void}
 */
export function drawCookingRing(context, column, row, part) {
  const x = column * CELL + RING.x;
  const y = row * CELL + RING.y;
  /** @type {(radius: number, to: number) => void} */
  const arc = (radius, to) => {
    context.beginPath();
    context.arc(x, y, radius, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * to);
  };
  arc(RING.disc, 1);
  context.fillStyle = '#fff';
  context.fill();
  context.strokeStyle = colour('--outline-dark');
  context.lineWidth = 1.6;
  context.stroke();
  context.lineWidth = RING.width;
  context.lineCap = 'butt';
  arc(RING.radius, 1);
  context.strokeStyle = '#e9e2d3';
  context.stroke();
  arc(RING.radius, part);
  context.strokeStyle = colour('--accent');
  context.stroke();
}
