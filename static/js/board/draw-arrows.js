// Draws predicted moves: one path on the floor that starts at the chef. Each step is an arrow, thinner and paler than
// the one before.

/** @import { Context, Style } from './draw-marks.js' */
/** @import { Mark } from './marks.js' */

import { DARK, PAINT, WHITE } from './draw-marks.js';
import { colour } from './sprites.js';

/** An arrow of the path at its full size, in 1/64 cell: half the shaft, half the head, and the head's length. */
const ARROW = { shaft: 6, head: 15, length: 21 };

/**
 * Draw a mark's arrow, which lies on the floor. A mark that is not a move gets one too, but invisible: in this way all
 * conditions of a study cost the browser the same.
 * @param {Context} context
 * @param {Mark} mark
 * @param {Style} style
 */
export function drawArrow(context, mark, { who, chef }) {
  const path = mark.kind === 'move' ? mark.points : [...mark.points, [mark.x + 1, mark.y]];
  const points = (mark.attached ? [chef, ...path] : path).map(([x, y]) => [x * 64 + 32, y * 64 + 32]);
  const size = mark.size * mark.grown;
  const strength = mark.opacity;
  context.globalAlpha = mark.kind === 'move' ? mark.shown : 0;
  context.lineJoin = context.lineCap = 'round';
  for (const [width, paint] of /** @type {const} */ ([
    [WHITE, colour('--outline-light')],
    [DARK, mixed('--outline-dark', strength)],
    [0, mixed(PAINT[who], strength)],
  ])) {
    context.strokeStyle = context.fillStyle = paint;
    traceArrow(context, points, size, width);
  }
  context.globalAlpha = 1;
}

/**
 * Fill an arrow along the points and widen it on all sides.
 * @type {(context: Context, points: number[][], size: number, outline: number) => void}
 */
function traceArrow(context, points, size, outline) {
  const [tipX, tipY] = points[points.length - 1];
  const [beforeX, beforeY] = points[points.length - 2];
  const far = Math.hypot(tipX - beforeX, tipY - beforeY) || 1;
  const [east, south] = [(tipX - beforeX) / far, (tipY - beforeY) / far];
  const length = ARROW.length * size;
  const half = ARROW.head * size;
  const [baseX, baseY] = [tipX - east * length, tipY - south * length];
  context.lineWidth = 2 * (ARROW.shaft * size + outline);
  context.beginPath();
  for (const [x, y] of points.slice(0, -1)) context.lineTo(x, y);
  context.lineTo(baseX, baseY);
  context.stroke();
  context.lineWidth = 2 * outline + 3; // 3: rounds the head's corners
  context.beginPath();
  context.moveTo(baseX - south * half, baseY + east * half);
  context.lineTo(tipX, tipY);
  context.lineTo(baseX + south * half, baseY - east * half);
  context.closePath();
  context.fill();
  context.stroke();
}

/** @type {Map<string, string>} */
const mixes = new Map();

/**
 * Return the colour that paint of this opacity has on the white backing. Solid colours do not darken where the parts of
 * an arrow overlap.
 * @param {string} name of a colour of tokens.css, as #rrggbb
 * @param {number} opacity 0..1
 */
function mixed(name, opacity) {
  const key = `${name}@${opacity}`;
  let mix = mixes.get(key);
  if (!mix) {
    const channels = [1, 3, 5].map((at) => parseInt(colour(name).slice(at, at + 2), 16));
    mix = `rgb(${channels.map((channel) => Math.round(255 + (channel - 255) * opacity)).join(', ')})`;
    mixes.set(key, mix);
  }
  return mix;
}
