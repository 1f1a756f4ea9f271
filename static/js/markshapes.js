// Draws marks (arrows.js) on a canvas: each shape in a white backing, nearly solid, and a coloured layer that carries the
// step's opacity: a far step grows paler but what lies below never shows through. Legends use the same shapes.

import { colour } from './sprites.js';

const MOVE = 'M22 -6.5 H51 V-16 Q51 -18.5 53.2 -17 L73.6 -1.8 Q76 0 73.6 1.8 L53.2 17 Q51 18.5 51 16 V6.5 H22 Q18.5 6.5 18.5 0 T22 -6.5 Z';
const BLUNT = 'M20 -6.5 H29 V-13.5 Q29 -17 32 -15.6 L40.5 -11 Q42.5 -10 42.5 -7.6 V7.6 Q42.5 10 40.5 11 L32 15.6 Q29 17 29 13.5 V6.5 H20 Q17 6.5 17 0 T20 -6.5 Z';
const WALL = 'M48.5 -15 V15';
const HAND = 'M-4.6 -17.4 Q-4.6 -22 0 -22 Q4.6 -22 4.6 -17.4 V-6 Q9 -7.6 11 -4.6 Q15 -5.4 16.4 -1.6 Q20.6 -1 20.6 3.6 C20.6 10 18.6 13 17.4 16 Q16.4 21 11.6 21 H-2.6 Q-6.6 21 -8.8 17.4 C-11.4 13 -14 9 -17.4 4.4 Q-20 0.6 -16.6 -1.6 Q-13.4 -3.6 -10 -0.2 L-4.6 4.6 Z';
const DISC = 'M-19 0 a19 19 0 1 1 38 0 a19 19 0 1 1 -38 0 Z';
const RING = 'M0 -11 A11 11 0 1 1 -0.01 -11';
const BACKING = 0.9;
const TURNS = [-Math.PI / 2, Math.PI / 2, 0, Math.PI]; // the shapes point east

// Box of each shape (x, y, width, height in 1/64 cell, origin = centre of the cell it starts from) and its own middle.
const SHAPES = {
  move: { box: [8, -30, 80, 60], middle: 47, lines: [], glyphs: [MOVE] },
  blunt: { box: [4, -30, 62, 60], middle: 34, lines: [[WALL, 4.5]], glyphs: [BLUNT] },
  hand: { box: [-30, -30, 60, 60], middle: 0, lines: [], glyphs: [DISC] },
  ring: { box: [-30, -30, 60, 60], middle: 0, lines: [[RING, 6]], glyphs: [] },
};
SHAPES.none = SHAPES.ring;

const paths = new Map();
function pathOf(data) {
  if (!paths.has(data)) paths.set(data, new Path2D(data));
  return paths.get(data);
}

function stroke(context, path, paint, width) {
  context.strokeStyle = paint;
  context.lineWidth = width;
  context.stroke(path);
}

function drawBack(context, shape) {
  const light = colour('--outline-light');
  for (const [data, width] of shape.lines) stroke(context, pathOf(data), light, width + 8);
  for (const data of shape.glyphs) {
    stroke(context, pathOf(data), light, 8.4);
    context.fillStyle = light;
    context.fill(pathOf(data));
  }
}

function drawFront(context, kind, shape, paint, ink) {
  for (const [data, width] of shape.lines) {
    stroke(context, pathOf(data), ink, width + 4);
    stroke(context, pathOf(data), paint, width);
  }
  for (const data of shape.glyphs) {
    stroke(context, pathOf(data), ink, 4.4);
    context.fillStyle = paint;
    context.fill(pathOf(data));
  }
  if (kind !== 'hand') return;
  context.translate(-0.8, 1.2);
  context.scale(0.62, 0.62);
  context.fillStyle = paint === colour('--human') ? colour('--outline-light') : ink;
  context.fill(pathOf(HAND));
}

const PAINT = { partner: '--partner', human: '--human', stale: '--steel' };

/** One layer ('back' or 'front') of a shape as a canvas; `scale`: device pixels per 1/64 cell. */
function layer(sprites, kind, part, who, scale) {
  const shape = SHAPES[kind];
  const [x, y, width, height] = shape.box;
  return sprites.raster(`mark-${kind}-${part}-${who}@${scale}`, width * scale, height * scale, (context) => {
    context.scale(scale, scale);
    context.translate(-x, -y);
    context.lineJoin = context.lineCap = 'round';
    if (part === 'back') drawBack(context, shape);
    else drawFront(context, kind, shape, colour(PAINT[who]), colour('--outline-dark'));
  });
}

/** Draws one mark; the context's unit is 1/64 cell, `scale` its device pixels. A mark of kind 'none' does the same work invisibly:
 * all conditions of a study cost the same. */
export function drawMark(context, sprites, mark, who, scale) {
  const shape = SHAPES[mark.kind];
  const [x, y, width, height] = shape.box;
  const shown = mark.kind === 'none' ? 0 : 1;
  const entering = mark.fresh ? mark.part : 1;
  context.save();
  context.translate(mark.x * 64 + 32 + mark.dx, mark.y * 64 + 32 + mark.dy);
  context.rotate(TURNS[mark.kind === 'move' || mark.kind === 'blunt' ? mark.direction : 2]);
  context.translate(shape.middle, 0);
  context.scale(mark.size, mark.size);
  context.translate(-shape.middle, 0);
  context.globalAlpha *= BACKING * entering * shown;
  context.drawImage(layer(sprites, mark.kind, 'back', who, scale), x, y, width, height);
  context.globalAlpha *= mark.opacity / BACKING / entering || 0;
  context.drawImage(layer(sprites, mark.kind, 'front', who, scale), x, y, width, height);
  context.restore();
}

/** Fills a legend's canvas (data-mark="move|blunt|hand|ring", data-opacity in %) with its shape. */
export function drawLegend(canvas, sprites, who = 'partner') {
  const kind = canvas.dataset.mark;
  const [x, y, width, height] = SHAPES[kind].box;
  const scale = (canvas.clientHeight || 34) / 60 * (window.devicePixelRatio || 1);
  canvas.width = width * scale;
  canvas.height = height * scale;
  const context = canvas.getContext('2d');
  context.scale(scale, scale);
  context.globalAlpha = BACKING;
  context.drawImage(layer(sprites, kind, 'back', who, scale), 0, 0, width, height);
  context.globalAlpha = Number(canvas.dataset.opacity ?? 100) / 100;
  context.drawImage(layer(sprites, kind, 'front', who, scale), 0, 0, width, height);
}
