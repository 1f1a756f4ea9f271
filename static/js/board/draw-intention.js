// Draws a predicted intention: a dotted line on the floor, an icon on the edge of the station, and a bubble next to the
// chef. The icon lies between station and floor: it must not cover a pot's lamp or an item on a counter.

/** @import { Context, Who } from './draw-marks.js' */
/** @import { Intention } from './intention.js' */
/** @import { Cell, Grid } from './kitchen.js' */
/** @import { Box } from './bubble-place.js' */
/** @import { Sprites } from './sprites.js' */

import { PAINT } from './draw-marks.js';
import { badgePlace, numberedStations } from './intention.js';
import { STEP } from './kitchen.js';
import { colour } from './sprites.js';

/** Sizes in 1/64 cell. */
const BADGE = { radius: 15, ring: 3, item: 21, arrow: 6 };
const DOTS = { gap: 11, light: 9, dark: 7, paint: 4.4 };
const BUBBLE = { padX: 8, padY: 5, corner: 8, border: 2.4, tail: 9 };
const NUMBER = { x: 12, y: 12, radius: 9.5, letters: 13 };
const BACKING = 0.92;

/** @typedef {{ sprites: Sprites, who: Who, scale: number, chef: Cell, shown: number, size: number }} IntentionStyle
 *   scale: device pixels per 1/64 cell; chef: where the watched chef is on screen; shown: 0..1 while it fades in; size:
 *   of the icon, 1 or more on small boards */

/**
 * Draw the way to the station. The dots are placed from the station, so that they stay in place while the chef walks.
 * @param {Context} context
 * @param {Intention} intention
 * @param {IntentionStyle} style
 */
export function drawWay(context, intention, { chef, who, shown }) {
  const { way, opacity } = intention;
  if (way.length < 2) return;
  const points = [...way.slice(1).reverse(), chef].map(([x, y]) => [x * 64 + 32, y * 64 + 32]);
  context.save();
  context.lineJoin = context.lineCap = 'round';
  context.setLineDash([0.1, DOTS.gap]);
  for (const [width, paint, alpha] of /** @type {const} */ ([
    [DOTS.light, colour('--outline-light'), BACKING],
    [DOTS.dark, colour('--outline-dark'), opacity],
    [DOTS.paint, colour(PAINT[who]), opacity],
  ])) {
    context.globalAlpha = alpha * shown;
    context.strokeStyle = paint;
    context.lineWidth = width;
    context.beginPath();
    for (const [x, y] of points) context.lineTo(x, y);
    context.stroke();
  }
  context.restore();
}

/**
 * Draw the icon: the item, and an arrow out of the station or into it.
 * @param {Context} context
 * @param {Intention} intention
 * @param {IntentionStyle} style
 */
export function drawBadge(context, intention, { sprites, who, scale, shown, size }) {
  const [x, y] = badgePlace(intention);
  const [east, south] = STEP[intention.side] ?? [0, -1];
  const turn = Math.atan2(south, east) + (intention.takes ? Math.PI : 0);
  context.save();
  context.translate(x, y);
  context.scale(size, size);
  context.globalAlpha = BACKING * shown;
  disc(context, BADGE.radius, colour('--outline-light'));
  context.globalAlpha = intention.opacity * shown;
  ring(context, BADGE.radius - BADGE.ring / 2, BADGE.ring + 2, colour('--outline-dark'));
  ring(context, BADGE.radius - BADGE.ring / 2, BADGE.ring, colour(PAINT[who]));
  const side = BADGE.item;
  const picture = intention.item ? sprites.at(`item-${intention.item}`, side * scale * size) : null;
  if (picture) context.drawImage(picture, -side / 2, -side / 2, side, side);
  context.rotate(turn);
  arrow(context, BADGE.radius - 4, BADGE.arrow, colour(PAINT[who]));
  context.restore();
}

/** @type {(context: Context, radius: number, paint: string) => void} */
function disc(context, radius, paint) {
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.fillStyle = paint;
  context.fill();
}

/** @type {(context: Context, radius: number, width: number, paint: string) => void} */
function ring(context, radius, width, paint) {
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.strokeStyle = paint;
  context.lineWidth = width;
  context.stroke();
}

/** A triangle that points east. @type {(context: Context, x: number, side: number, paint: string) => void} */
function arrow(context, x, side, paint) {
  context.beginPath();
  context.moveTo(x, -side);
  context.lineTo(x + 1.3 * side, 0);
  context.lineTo(x, side);
  context.closePath();
  context.lineJoin = 'round';
  context.lineWidth = 6;
  context.strokeStyle = colour('--outline-light');
  context.stroke();
  context.lineWidth = 3;
  context.strokeStyle = colour('--outline-dark');
  context.stroke();
  context.fillStyle = paint;
  context.fill();
}

/**
 * Draw the numbers by which the words name stations, on their upper left: a pot has its clock on the right.
 * @param {Context} context
 * @param {Grid} grid
 * @param {number} size 1 or more on small boards
 */
export function drawStationNumbers(context, grid, size) {
  for (const { x, y, number } of numberedStations(grid)) {
    context.save();
    context.translate(x * 64 + NUMBER.x * size, y * 64 + NUMBER.y * size);
    context.scale(size, size);
    disc(context, NUMBER.radius, colour('--card'));
    ring(context, NUMBER.radius, 1.4, colour('--outline-dark'));
    context.fillStyle = colour('--ink');
    context.font = fontOf(NUMBER.letters);
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.fillText(String(number), 0, 0.5);
    context.restore();
  }
}

/** @param {number} size in 1/64 cell */
const fontOf = (size) => `650 ${size}px ${colour('--font')}`;

/**
 * Return the words in one line, and in two if they can be split, with the size of the bubble.
 * @param {Context} context
 * @param {string} words
 * @param {number} size of the letters, in 1/64 cell
 * @returns {{ lines: string[], width: number, height: number }[]}
 */
export function bubbleShapes(context, words, size) {
  context.font = fontOf(size);
  const ways = [[words], split(words)].filter((lines) => lines.length);
  return ways.map((lines) => ({
    lines,
    width: Math.max(...lines.map((line) => context.measureText(line).width)) + 2 * BUBBLE.padX,
    height: lines.length * size * 1.2 + 2 * BUBBLE.padY,
  }));
}

/**
 * Return two lines of about the same length; none for a single short word.
 * @param {string} words
 * @returns {string[]}
 */
function split(words) {
  const places = [...words].map((letter, at) => (letter === ' ' ? at : -1)).filter((at) => at > 0);
  const isSpaced = places.length > 0;
  if (!isSpaced && words.length < 6) return [];
  const middle = words.length / 2;
  const nearest = places.reduce((a, b) => (Math.abs(b - middle) < Math.abs(a - middle) ? b : a), places[0]);
  const at = isSpaced ? nearest : Math.ceil(middle);
  return [words.slice(0, at), words.slice(at).trimStart()];
}

/**
 * Draw the bubble with its tail towards the chef.
 * @param {Context} context
 * @param {{ box: Box, lines: string[], size: number }} bubble
 * @param {number} opacity of its edge, 0..1
 * @param {IntentionStyle} style
 */
export function drawBubble(context, { box, lines, size }, opacity, { chef, who, shown }) {
  context.save();
  context.lineJoin = 'round';
  const paths = [boxOutline(box), tailOutline(box, [chef[0] * 64 + 32, chef[1] * 64 + 26])];
  for (const [width, paint, alpha] of /** @type {const} */ ([
    [2 * BUBBLE.border + 3, colour('--outline-dark'), opacity],
    [2 * BUBBLE.border, colour(PAINT[who]), opacity],
  ])) {
    context.globalAlpha = alpha * shown;
    context.strokeStyle = paint;
    context.lineWidth = width;
    for (const path of paths) context.stroke(path);
  }
  context.globalAlpha = shown;
  context.fillStyle = colour('--card');
  for (const path of paths) context.fill(path);
  context.fillStyle = colour('--ink');
  context.font = fontOf(size);
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  lines.forEach((line, k) => {
    context.fillText(line, box.left + box.width / 2, box.top + BUBBLE.padY + (k + 0.55) * size * 1.2);
  });
  context.restore();
}

/**
 * @param {Box} box
 * @returns {Path2D}
 */
function boxOutline({ left, top, width, height }) {
  const path = new Path2D();
  const [right, bottom, corner] = [left + width, top + height, BUBBLE.corner];
  path.moveTo(left + corner, top);
  path.arcTo(right, top, right, bottom, corner);
  path.arcTo(right, bottom, left, bottom, corner);
  path.arcTo(left, bottom, left, top, corner);
  path.arcTo(left, top, right, top, corner);
  path.closePath();
  return path;
}

/**
 * Return the tail: from within the box a little over its edge.
 * @param {Box} box
 * @param {readonly number[]} towards
 * @returns {Path2D}
 */
function tailOutline(box, [toX, toY]) {
  const { left, top, width, height } = box;
  const path = new Path2D();
  const inside = BUBBLE.corner + 5;
  const x = Math.max(left + inside, Math.min(left + width - inside, toX));
  const y = Math.max(top + inside / 2, Math.min(top + height - inside / 2, toY));
  const far = Math.hypot(toX - x, toY - y);
  if (far < inside) return path;
  const [east, south] = [(toX - x) / far, (toY - y) / far];
  const edge = Math.min(far, edgeAt(x, y, east, south, box) + BUBBLE.tail);
  path.moveTo(x - 5 * south, y + 5 * east);
  path.lineTo(x + edge * east, y + edge * south);
  path.lineTo(x + 5 * south, y - 5 * east);
  path.closePath();
  return path;
}

/** How far the edge of a box is from a place in it, in one direction.
 * @type {(x: number, y: number, east: number, south: number, box: Box) => number} */
function edgeAt(x, y, east, south, { left, top, width, height }) {
  const across = east > 0 ? (left + width - x) / east : east < 0 ? (left - x) / east : Infinity;
  const down = south > 0 ? (top + height - y) / south : south < 0 ? (top - y) / south : Infinity;
  return Math.min(across, down);
}
