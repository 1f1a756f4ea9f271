// Draws the marks that are not moves (draw-arrows.js draws those): small icons inside the cell where the chef will be,
// so that no mark hides a station.
// Each shape has a white backing, nearly solid, and a coloured layer that carries the step's opacity: a later step is
// paler, but the background does not show through. Legends use the same shapes.

/** @import { Cell } from './kitchen.js' */
/** @import { Mark } from './marks.js' */
/** @import { Sprites } from './sprites.js' */

import { context2d } from '../browser/dom.js';
import { SOUTH, STEP } from './kitchen.js';
import { blank, colour } from './sprites.js';

/** @typedef {CanvasRenderingContext2D} Context */
/** @typedef {'partner' | 'human' | 'stale'} Who whose next steps the marks show; stale: they are too old */
/**
 * @typedef {object} Shape
 * @property {boolean} turns whether it points in the direction of the step
 * @property {[x: number, y: number, width: number, height: number]} box in 1/64 cell; the origin is the centre of the
 *   cell that the step starts from
 * @property {number} middle its own middle, east of the origin
 * @property {[path: string, width: number][]} lines
 * @property {string[]} glyphs
 */

const MOVE =
  'M22 -6.5 H51 V-16 Q51 -18.5 53.2 -17 L73.6 -1.8 Q76 0 73.6 1.8 L53.2 17 Q51 18.5 51 16 V6.5 H22 ' +
  'Q18.5 6.5 18.5 0 T22 -6.5 Z';
const BLUNT =
  'M13 -4.6 H18 V-9 Q18 -11.6 20.2 -10.6 L26 -7.6 Q27.4 -6.8 27.4 -5.2 V5.2 Q27.4 6.8 26 7.6 L20.2 10.6 ' +
  'Q18 11.6 18 9 V4.6 H13 Q11 4.6 11 0 T13 -4.6 Z';
const WALL = 'M32.5 -10 V10';
const HAND =
  'M-4.6 -17.4 Q-4.6 -22 0 -22 Q4.6 -22 4.6 -17.4 V-6 Q9 -7.6 11 -4.6 Q15 -5.4 16.4 -1.6 Q20.6 -1 20.6 3.6 ' +
  'C20.6 10 18.6 13 17.4 16 Q16.4 21 11.6 21 H-2.6 Q-6.6 21 -8.8 17.4 C-11.4 13 -14 9 -17.4 4.4 ' +
  'Q-20 0.6 -16.6 -1.6 Q-13.4 -3.6 -10 -0.2 L-4.6 4.6 Z';
const DISC = 'M-12 0 a12 12 0 1 1 24 0 a12 12 0 1 1 -24 0 Z';
const RING = 'M0 -8 A8 8 0 1 1 -0.01 -8';
const BACKING = 0.9;
/** Outlines on each side, in 1/64 cell: the dark one, and the white one around it. */
export const DARK = 2;
export const WHITE = 4;
/** Every icon turns within a square of this side, in 1/64 cell. */
const SIDE = 48;
const TURNS = [-Math.PI / 2, Math.PI / 2, 0, Math.PI]; // the shapes point east
/** Where the number of repeats stands, from the icon's middle. */
const COUNT = { y: 19, size: 14 };

/** @type {Shape} */
const RING_SHAPE = { turns: false, box: [-21, -21, 42, 42], middle: 0, lines: [[RING, 4.6]], glyphs: [] };
/** @type {Record<Mark['kind'], Shape>} */
const SHAPES = {
  move: { turns: true, box: [8, -30, 80, 60], middle: 47, lines: [], glyphs: [MOVE] },
  blunt: { turns: true, box: [2, -21, 40, 42], middle: 22, lines: [[WALL, 4]], glyphs: [BLUNT] },
  hand: { turns: true, box: [-21, -21, 42, 42], middle: 0, lines: [], glyphs: [DISC] },
  ring: RING_SHAPE,
  none: RING_SHAPE,
};

/** @type {Map<string, Path2D>} */
const paths = new Map();

/**
 * @param {string} data
 * @returns {Path2D}
 */
function pathOf(data) {
  let path = paths.get(data);
  if (!path) {
    path = new Path2D(data);
    paths.set(data, path);
  }
  return path;
}

/** @type {(context: Context, path: Path2D, paint: string, width: number) => void} */
function stroke(context, path, paint, width) {
  context.strokeStyle = paint;
  context.lineWidth = width;
  context.stroke(path);
}

/** @type {(context: Context, shape: Shape) => void} */
function drawBack(context, shape) {
  const light = colour('--outline-light');
  for (const [data, width] of shape.lines) stroke(context, pathOf(data), light, width + 2 * WHITE);
  for (const data of shape.glyphs) {
    stroke(context, pathOf(data), light, 2 * WHITE);
    context.fillStyle = light;
    context.fill(pathOf(data));
  }
}

/** @type {(context: Context, kind: Mark['kind'], shape: Shape, paint: string, ink: string) => void} */
function drawFront(context, kind, shape, paint, ink) {
  for (const [data, width] of shape.lines) {
    stroke(context, pathOf(data), ink, width + 2 * DARK);
    stroke(context, pathOf(data), paint, width);
  }
  for (const data of shape.glyphs) {
    stroke(context, pathOf(data), ink, 2 * DARK);
    context.fillStyle = paint;
    context.fill(pathOf(data));
  }
  if (kind !== 'hand') return;
  context.rotate(Math.PI / 2); // the hand's drawing points north
  context.translate(-0.5, 0.8);
  context.scale(0.4, 0.4);
  context.fillStyle = paint === colour('--human') ? colour('--outline-light') : ink;
  context.fill(pathOf(HAND));
}

/** @type {Record<Who, string>} */
export const PAINT = { partner: '--partner', human: '--human', stale: '--steel' };

/**
 * Draw a layer of a shape in the middle of a new canvas, turned and at its size.
 * @param {number} side of the canvas, in device pixels
 * @param {Mark} mark
 * @param {number} scale device pixels per 1/64 cell
 * @param {(context: Context) => void} draw
 */
function layer(side, mark, scale, draw) {
  const shape = SHAPES[mark.kind];
  const canvas = blank(side, side);
  const context = context2d(canvas);
  context.setTransform(1, 0, 0, 1, side / 2, side / 2);
  context.rotate(TURNS[mark.direction] * Number(shape.turns));
  context.scale(scale * mark.size, scale * mark.size);
  context.translate(-shape.middle, 0);
  context.lineJoin = context.lineCap = 'round';
  draw(context);
  return canvas;
}

/**
 * Return the whole mark as a canvas whose middle is the mark's own middle.
 * @param {Sprites} sprites
 * @param {Mark} mark
 * @param {Who} who
 * @param {number} scale device pixels per 1/64 cell
 */
function raster(sprites, mark, who, scale) {
  const shape = SHAPES[mark.kind];
  const side = Math.ceil(SIDE * scale * mark.size);
  const key = `${mark.kind}-${shape.turns ? mark.direction : 2}-${mark.size}-${mark.opacity}-${who}@${scale}`;
  return sprites.raster(key, side, side, (context) => {
    const paint = colour(PAINT[who]);
    const ink = colour('--outline-dark');
    context.globalAlpha = BACKING;
    context.drawImage(
      layer(side, mark, scale, (each) => drawBack(each, shape)),
      0,
      0,
    );
    context.globalAlpha = mark.opacity;
    context.drawImage(
      layer(side, mark, scale, (each) => drawFront(each, mark.kind, shape, paint, ink)),
      0,
      0,
    );
  });
}

/** @typedef {{ sprites: Sprites, who: Who, scale: number, chef: Cell, cell: Cell }} Style scale: device pixels per 1/64
 *   cell; chef: where the watched chef is on screen; cell: where it is in the kitchen */

/**
 * Draw a mark's icon: a single picture, rasterised once, and the number of repeats. A move gets an invisible one.
 * @param {Context} context
 * @param {Mark} mark
 * @param {Style} style
 */
export function drawIcon(context, mark, { sprites, who, scale, chef, cell }) {
  const kind = mark.kind === 'move' ? 'none' : mark.kind;
  const shape = SHAPES[kind];
  const image = raster(sprites, { ...mark, kind }, who, scale);
  const side = (image.width / scale) * mark.grown;
  const [east, south] = shape.turns ? STEP[mark.direction] : [0, 0];
  const [glideX, glideY] = mark.attached ? [chef[0] - cell[0], chef[1] - cell[1]] : [0, 0];
  const x = (mark.x + glideX) * 64 + 32 + mark.dx + east * shape.middle;
  const y = (mark.y + glideY) * 64 + 32 + mark.dy + south * shape.middle;
  const snapped = (/** @type {number} */ place) => Math.round((place - side / 2) * scale) / scale;
  context.globalAlpha = kind === 'none' ? 0 : mark.shown;
  context.drawImage(image, snapped(x), snapped(y), side, side);
  if (mark.count > 1) drawCount(context, mark, x, y);
  context.globalAlpha = 1;
}

/** @type {(context: Context, mark: Mark, x: number, y: number) => void} */
function drawCount(context, { count, direction, kind }, x, y) {
  const words = `×${count}`;
  const below = y + (kind === 'hand' && direction === SOUTH ? -COUNT.y : COUNT.y);
  context.font = `800 ${COUNT.size}px ${colour('--font')}`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.lineJoin = 'round';
  context.lineWidth = 5;
  context.strokeStyle = colour('--outline-light');
  context.strokeText(words, x, below);
  context.fillStyle = colour('--outline-dark');
  context.fillText(words, x, below);
}

/** @typedef {Record<string, string | number>} Attributes */

/** @type {(name: string, attributes: Attributes, children?: SVGElement[]) => SVGElement} */
function svg(name, attributes, children = []) {
  const element = /** @type {SVGElement} */ (document.createElementNS('http://www.w3.org/2000/svg', name));
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  element.append(...children);
  return element;
}

/**
 * Put the shape into a legend as an SVG picture. (A canvas each would cost the board's every frame a copy.)
 * @param {HTMLElement} place has data-mark="move|blunt|hand|ring" and perhaps data-opacity in %
 */
export function drawLegend(place) {
  const { opacity = 100 } = place.dataset;
  const kind = /** @type {Mark['kind']} */ (place.dataset.mark);
  const { box, lines, glyphs } = SHAPES[kind];
  const light = colour('--outline-light');
  const ink = colour('--outline-dark');
  const paint = colour('--partner');
  /** @type {(d: string, stroke: string, width: number) => SVGElement} */
  const line = (d, stroke, width) => svg('path', { d, stroke, fill: 'none', 'stroke-width': width });
  const back = [
    ...lines.map(([d, width]) => line(d, light, width + 2 * WHITE)),
    ...glyphs.map((d) => svg('path', { d, fill: light, stroke: light, 'stroke-width': 2 * WHITE })),
  ];
  const front = [
    ...lines.flatMap(([d, width]) => [line(d, ink, width + 2 * DARK), line(d, paint, width)]),
    ...glyphs.flatMap((d) => [line(d, ink, 2 * DARK), svg('path', { d, fill: paint })]),
    ...(kind === 'hand' ? [svg('path', { d: HAND, fill: ink, transform: 'translate(-.5 .8) scale(.4)' })] : []),
  ];
  const layers = [svg('g', { opacity: BACKING }, back), svg('g', { opacity: Number(opacity) / 100 }, front)];
  const round = { 'stroke-linejoin': 'round', 'stroke-linecap': 'round' };
  place.replaceChildren(svg('svg', { viewBox: box.join(' '), ...round }, layers));
}
