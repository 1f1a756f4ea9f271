// Effects: steam, bubbles, sparks, the +20. Each is a function of the event and the time; reduced motion turns movement
// off.

/** @import { BoardEvent } from './events.js' */
/** @import { Pot } from './kitchen.js' */

import { CELL } from './background.js';
import { COOK_TIME } from './kitchen.js';
import { colour } from './sprites.js';

/** @typedef {CanvasRenderingContext2D} Context */
/** @typedef {Pick<BoardEvent, 'kind' | 'x' | 'y'> & { bornMs: number, bornT: number }} Effect */

const POP_MS = 1100;
const SPARK_MS = 650;
const REDUCED_POP_TICKS = 6;
const MAX_AGE_MS = 3000;
const MAX_SHOWN = 24;
const GOLD = '#ffd766';

export class Effects {
  constructor() {
    /** @type {Effect[]} */
    this.shown = [];
    /** Whether the page shows the points of a soup itself, on their flight to the score. */
    this.pointsFly = false;
  }

  /**
   * Add the effects of what just happened.
   * @param {BoardEvent[]} list
   * @param {number} now
   * @param {number} timestep
   */
  add(list, now, timestep) {
    for (const { kind, x, y } of list) {
      if (['delivery', 'ready', 'potted'].includes(kind)) this.shown.push({ kind, x, y, bornMs: now, bornT: timestep });
    }
    this.shown = this.shown.filter((each) => now - each.bornMs < MAX_AGE_MS).slice(-MAX_SHOWN);
  }

  /**
   * Draw all of them above the board.
   * @param {Context} context
   * @param {number} now
   * @param {number} timestep
   * @param {boolean} reduced
   * @param {number} columns of the board
   */
  draw(context, now, timestep, reduced, columns) {
    for (const each of this.shown) {
      const age = now - each.bornMs;
      if (each.kind === 'delivery' && reduced) drawPoints(context, each, timestep - each.bornT, columns);
      else if (each.kind === 'delivery') drawMovingPoints(context, each, age, columns, !this.pointsFly);
      else if (!reduced && age < SPARK_MS) sparks(context, each, age / SPARK_MS, each.kind === 'ready' ? 8 : 5);
    }
  }
}

/** @type {(context: Context, effect: Effect, ageTicks: number, columns: number) => void} */
function drawPoints(context, effect, ageTicks, columns) {
  if (ageTicks < REDUCED_POP_TICKS) label(context, '+20', effect, { columns, rise: 0, grow: 1, opacity: 1 });
}

/** @type {(context: Context, effect: Effect, ageMs: number, columns: number, named: boolean) => void} */
function drawMovingPoints(context, effect, ageMs, columns, named) {
  if (ageMs >= POP_MS) return;
  const part = ageMs / POP_MS;
  if (ageMs < SPARK_MS) sparks(context, effect, ageMs / SPARK_MS, 12);
  if (!named) return;
  const grow = Math.min(1, part * 6) * (1 + 0.25 * Math.max(0, 1 - part * 5));
  const opacity = part < 0.7 ? 1 : (1 - part) / 0.3;
  label(context, '+20', effect, { columns, rise: 30 * (1 - (1 - part) ** 2), grow, opacity });
}

/** @typedef {{ columns: number, rise: number, grow: number, opacity: number }} LabelStyle */

/** @type {(context: Context, text: string, effect: Effect, style: LabelStyle) => void} */
function label(context, text, { x, y }, { columns, rise, grow, opacity }) {
  context.save();
  context.globalAlpha *= opacity;
  const left = Math.min(columns * CELL - 42, Math.max(42, x * CELL + CELL / 2)); // keeps it on the board
  context.translate(left, Math.max(24, y * CELL + 14 - rise));
  context.scale(grow, grow);
  context.font = `800 30px ${colour('--font')}`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.lineJoin = 'round';
  context.lineWidth = 11;
  context.strokeStyle = colour('--outline-light');
  context.strokeText(text, 0, 0);
  context.lineWidth = 6;
  context.strokeStyle = colour('--outline-dark');
  context.strokeText(text, 0, 0);
  context.fillStyle = GOLD;
  context.fillText(text, 0, 0);
  context.restore();
}

/** @type {(context: Context, effect: Effect, part: number, count: number) => void} */
function sparks(context, { x, y }, part, count) {
  const reach = 16 + 30 * (1 - (1 - part) ** 3);
  const radius = 4.4 * (1 - part) + 1;
  context.save();
  context.globalAlpha *= 1 - part;
  context.lineWidth = 1.4;
  context.strokeStyle = colour('--outline-dark');
  for (let i = 0; i < count; i += 1) {
    const angle = (i / count) * 2 * Math.PI + 0.4;
    const left = x * CELL + 32 + reach * Math.cos(angle);
    const top = y * CELL + 28 + reach * 0.8 * Math.sin(angle);
    context.fillStyle = i % 2 ? GOLD : '#fff4d6';
    context.beginPath();
    context.arc(left, top, radius, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
  context.restore();
}

/**
 * Draw bubbles on a cooking soup and steam over a pot, as functions of the time alone.
 * @type {(context: Context, pot: Pot, now: number) => void}
 */
export function drawPotEffects(context, [x, y, , cooking], now) {
  const left = x * CELL;
  const top = y * CELL;
  const ready = cooking >= COOK_TIME;
  if (!ready) bubbles(context, left, top, now);
  steam(context, left + 32, top + (ready ? 4 : 10), now, ready ? 0.75 : 0.3 + 0.3 * (cooking / COOK_TIME));
}

/** @type {(context: Context, left: number, top: number, now: number) => void} */
function bubbles(context, left, top, now) {
  for (let i = 0; i < 3; i += 1) {
    const part = (now / 700 + i / 3) % 1;
    context.globalAlpha = 0.9 * (1 - part);
    context.fillStyle = '#ffe2a6';
    context.strokeStyle = '#b4762a';
    context.lineWidth = 1;
    context.beginPath();
    context.arc(left + 22 + i * 9, top + 24 - 2 * part - (i % 2) * 3, 1 + 2.6 * part, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
  context.globalAlpha = 1;
}

/** @type {(context: Context, x: number, y: number, now: number, strength: number) => void} */
function steam(context, x, y, now, strength) {
  context.strokeStyle = '#ffffff';
  context.lineCap = 'round';
  for (let i = 0; i < 3; i += 1) {
    const part = (now / 1800 + i / 3) % 1;
    context.globalAlpha = strength * Math.sin(Math.PI * part);
    context.lineWidth = 3 + 2 * part;
    const rise = y + 8 - 26 * part;
    const from = x + (i - 1) * 10;
    const sway = 4 * Math.sin(now / 420 + i * 2);
    context.beginPath();
    context.moveTo(from, rise + 7);
    context.quadraticCurveTo(from + sway, rise + 2, from - sway / 2, rise - 5);
    context.stroke();
  }
  context.globalAlpha = 1;
}
