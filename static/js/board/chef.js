// Draws one chef with its item and small movements, and the tag over the participant's own chef. Units: 1/64 cell.

/** @import { Sprites } from './sprites.js' */

import { CELL } from './background.js';
import { FACINGS, ITEMS, STEP } from './kitchen.js';
import { colour } from './sprites.js';

/**
 * @typedef {object} Motion how a chef moves within this tick
 * @property {'walk' | 'bump' | 'use' | 'rest'} kind
 * @property {number} part of the tick, 0..1
 * @property {number} now in ms
 * @property {number} stride 1 or -1: which foot
 */
/**
 * @typedef {object} Chef
 * @property {'blue' | 'green'} who
 * @property {number} x in cells, may be a fraction
 * @property {number} y
 * @property {number} facing
 * @property {number} held
 * @property {Motion | null} motion
 * @property {boolean} isOwn
 * @property {number} cellPixels
 */

/** What is held: offset from the cell's centre, side, and whether it lies behind the chef; by direction N S E W. */
const HELD = [
  { x: 17, y: -2, side: 27, behind: true },
  { x: 0, y: 17, side: 30, behind: false },
  { x: 21, y: 13, side: 30, behind: false },
  { x: -21, y: 13, side: 30, behind: false },
];

/** @type {(context: CanvasRenderingContext2D, sprites: Sprites, chef: Chef) => void} */
export function drawChef(context, sprites, chef) {
  const pose = poseOf(chef);
  const scale = chef.cellPixels / CELL;
  /** @type {(name: string, x: number, y: number, side: number) => void} */
  const put = (name, x, y, side) => context.drawImage(sprites.at(name, side * scale), x, y, side, side);
  context.save();
  context.translate(chef.x * CELL + 32 + pose.dx, chef.y * CELL + 32 + pose.dy);
  context.translate(0, 27); // turn and squash about the feet
  context.rotate(pose.lean);
  context.scale(pose.wide, pose.tall);
  context.translate(0, -27);
  const { x, y, side, behind } = HELD[chef.facing];
  const drawItem = () => {
    if (chef.held) put(`item-${ITEMS[chef.held]}`, x - side / 2, y - side / 2 + pose.itemLift, side);
  };
  if (behind) drawItem();
  put(`chef-${chef.who}-${FACINGS[chef.facing]}`, -32, -35, CELL);
  if (!behind) drawItem();
  context.restore();
}

const STILL = { dx: 0, dy: 0, lean: 0, wide: 1, tall: 1, itemLift: 0 };

/** @param {Chef} chef */
function poseOf({ motion, facing, who }) {
  if (!motion) return STILL;
  const { kind, part, now, stride } = motion;
  const arch = Math.sin(Math.PI * part); // 0 at both ends of the tick
  const [columns, rows] = STEP[facing];
  if (kind === 'walk') return { ...STILL, dy: -4 * arch, lean: 0.05 * stride * arch, itemLift: -2 * arch };
  if (kind === 'bump') {
    return { ...STILL, dx: 4 * columns * arch, dy: 4 * rows * arch, wide: 1 + 0.03 * arch, tall: 1 - 0.03 * arch };
  }
  if (kind === 'use') {
    return { ...STILL, dx: 6 * columns * arch, dy: 6 * rows * arch, wide: 1 - 0.04 * arch, tall: 1 + 0.05 * arch };
  }
  const breath = Math.sin(now / 480 + (who === 'blue' ? 0 : 2));
  return { ...STILL, wide: 1 - 0.006 * breath, tall: 1 + 0.014 * breath, itemLift: -0.8 * breath };
}

const TAG = new Path2D('M-17 -9 h34 a8.5 8.5 0 0 1 0 17 h-13 l-4 5 l-4 -5 h-13 a8.5 8.5 0 0 1 0 -17 z');

/** @typedef {'above' | 'below' | 'feet'} TagSide where the tag hides nothing */
/** @type {Record<TagSide, number>} the tag's middle, from the centre of the cell */
const TAG_Y = { above: -44, below: 44, feet: 24 };

/**
 * Draw the tag of the own chef. Call it after all chefs are drawn.
 * @type {(context: CanvasRenderingContext2D, text: string, chef: Chef, side: TagSide, scale: number) => void}
 */
export function drawTag(context, text, chef, side, scale) {
  const { dx, dy } = poseOf(chef);
  const y = chef.y * CELL + 32 + TAG_Y[side] + dy / 2;
  context.save();
  context.translate(chef.x * CELL + 32 + dx, Math.max(10 * scale, y));
  context.scale(scale, scale);
  context.lineJoin = 'round';
  context.lineWidth = 2.4;
  context.strokeStyle = '#fff';
  context.fillStyle = colour('--human');
  context.scale(1, side === 'above' ? 1 : -1); // its tip points at the chef
  context.stroke(TAG);
  context.fill(TAG);
  context.scale(1, side === 'above' ? 1 : -1);
  context.fillStyle = '#fff';
  context.font = `700 12px ${colour('--font')}`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillText(text, 0, 0, 42);
  context.restore();
}
