// Small delights: steam, bubbles, sparks, the +20. Pure pictures of (what, when); none of them moves when motion is reduced.

import { COOK_TIME } from './kitchen.js';
import { CELL } from './background.js';
import { colour } from './sprites.js';

const POP_MS = 1100, SPARK_MS = 650;
const REDUCED_POP_TICKS = 6;

export class Effects {
  constructor() {
    this.shown = []; // {kind, x, y, bornMs, bornT}
  }

  /** Takes in what just happened (events.js). */
  add(list, now, timestep) {
    for (const { kind, x, y } of list) {
      if (kind === 'delivery' || kind === 'ready' || kind === 'potted') this.shown.push({ kind, x, y, bornMs: now, bornT: timestep });
    }
    this.shown = this.shown.filter((each) => now - each.bornMs < 3000 && this.shown.length - this.shown.indexOf(each) < 24);
  }

  /** Draws all of them above the board. */
  draw(context, now, timestep, reduced, columns) {
    for (const each of this.shown) {
      const age = now - each.bornMs;
      if (each.kind === 'delivery') delivery(context, each, age, reduced ? timestep - each.bornT : null, columns);
      else if (!reduced && age < SPARK_MS) sparks(context, each, age / SPARK_MS, each.kind === 'ready' ? 8 : 5);
    }
  }
}

/** `ticks`: its age in timesteps where motion is reduced (it only stands there), else null. */
function delivery(context, { x, y }, age, ticks, columns) {
  const reduced = ticks !== null;
  if (reduced ? ticks >= REDUCED_POP_TICKS : age >= POP_MS) return;
  const part = reduced ? 0.35 : age / POP_MS;
  if (!reduced && age < SPARK_MS) sparks(context, { x, y }, age / SPARK_MS, 12);
  const grow = reduced ? 1 : Math.min(1, part * 6) * (1 + 0.25 * Math.max(0, 1 - part * 5));
  context.save();
  context.globalAlpha *= part < 0.7 ? 1 : (1 - part) / 0.3;
  context.translate(Math.min(columns * CELL - 42, Math.max(42, x * CELL + CELL / 2)), Math.max(24, y * CELL + 14 - (reduced ? 0 : 30 * (1 - (1 - part) ** 2))));
  context.scale(grow, grow);
  context.font = `800 30px ${colour('--font')}`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.lineJoin = 'round';
  label(context, '+20');
  context.restore();
}

function label(context, text) {
  context.lineWidth = 11;
  context.strokeStyle = colour('--outline-light');
  context.strokeText(text, 0, 0);
  context.lineWidth = 6;
  context.strokeStyle = colour('--outline-dark');
  context.strokeText(text, 0, 0);
  context.fillStyle = '#ffd766';
  context.fillText(text, 0, 0);
}

function sparks(context, { x, y }, part, count) {
  const reach = 16 + 30 * (1 - (1 - part) ** 3);
  context.save();
  context.globalAlpha *= 1 - part;
  context.lineWidth = 1.4;
  context.strokeStyle = colour('--outline-dark');
  for (let i = 0; i < count; i += 1) {
    const angle = (i / count) * 2 * Math.PI + 0.4;
    context.fillStyle = i % 2 ? '#ffd766' : '#fff4d6';
    context.beginPath();
    context.arc(x * CELL + 32 + reach * Math.cos(angle), y * CELL + 28 + reach * 0.8 * Math.sin(angle), 4.4 * (1 - part) + 1, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
  context.restore();
}

/** Bubbles on a cooking soup, steam over a pot: functions of the time alone. */
export function potLife(context, [x, y, , tick], now) {
  const left = x * CELL, top = y * CELL;
  const ready = tick >= COOK_TIME;
  if (!ready) bubbles(context, left, top, now);
  wisps(context, left + 32, top + (ready ? 4 : 10), now, ready ? 0.75 : 0.3 + 0.3 * (tick / COOK_TIME));
}

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

function wisps(context, x, y, now, strength) {
  context.strokeStyle = '#ffffff';
  context.lineCap = 'round';
  for (let i = 0; i < 3; i += 1) {
    const part = (now / 1800 + i / 3) % 1;
    context.globalAlpha = strength * Math.sin(Math.PI * part);
    context.lineWidth = 3 + 2 * part;
    const rise = y + 8 - 26 * part, from = x + (i - 1) * 10, sway = 4 * Math.sin(now / 420 + i * 2);
    context.beginPath();
    context.moveTo(from, rise + 7);
    context.quadraticCurveTo(from + sway, rise + 2, from - sway / 2, rise - 5);
    context.stroke();
  }
  context.globalAlpha = 1;
}
