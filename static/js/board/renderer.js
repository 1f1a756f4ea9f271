// One picture of the state: board, pots, items, predicted steps, chefs, effects. Reads the state, never changes it.

import { eased, isStale } from './marks.js';
import { CELL, contactShadow, paintBoard } from './background.js';
import { Effects, potLife } from './effects.js';
import { events } from './events.js';
import { drawChef, drawTag } from './chef.js';
import { COOK_TIME, ITEMS } from './kitchen.js';
import { drawMark } from './draw-marks.js';
import { colour } from './sprites.js';
import { facing, place, progress } from './state.js';

const PUT_MS = 160; // an item just put down lands
const RING = { x: 51, y: 15, radius: 8.4, disc: 13.4, width: 5.6 };

export class Renderer {
  /** `youText`: the tag over the own chef. */
  constructor(canvas, sprites, youText) {
    Object.assign(this, { canvas, sprites, youText, cellPixels: 0, still: null, grid: null, tagScale: 1, spot: null });
    this.context = canvas.getContext('2d');
    this.effects = new Effects();
    this.landed = new Map(); // "x,y" -> when an item was put there
  }

  /** Fits the canvas into width x height CSS pixels, a whole number of device pixels a cell. Returns the size of a cell in CSS pixels. */
  fit(grid, width, height) {
    const ratio = window.devicePixelRatio || 1;
    const columns = grid[0].length, rows = grid.length;
    const cell = Math.max(8, Math.floor(Math.min(width / columns, height / rows) * ratio));
    if (cell !== this.cellPixels || grid !== this.grid) {
      this.sprites.resized();
      this.cellPixels = cell;
      this.grid = grid;
      this.still = paintBoard(grid, this.sprites, cell);
      this.canvas.width = columns * cell;
      this.canvas.height = rows * cell;
      this.canvas.dataset.columns = columns;
      this.canvas.style.width = `${columns * cell / ratio}px`;
      this.canvas.style.height = `${rows * cell / ratio}px`;
      this.tagScale = Math.min(1.5, Math.max(1, 52 / (cell / ratio)));
    }
    return cell / ratio;
  }

  /** Starts the effects of what happened between the last two kitchens; returns what happened (events.js). */
  took(state, now) {
    const list = events(state.previous, state.current, state.actions, state.game.grid);
    this.effects.add(list, now, state.current.t);
    for (const { kind, x, y } of list) if (kind === 'put') this.landed.set(`${x},${y}`, now);
    return list;
  }

  /** Draws the state as it is at `now`. */
  draw(state, now, reduced) {
    if (!this.still || !state.current) return;
    const context = this.context;
    const scale = this.cellPixels / CELL;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.globalAlpha = 1;
    context.drawImage(this.still, 0, 0);
    context.setTransform(scale, 0, 0, scale, 0, 0);
    this.#pots(state, now, reduced);
    this.#items(state, now, reduced);
    this.#marks(state, now, reduced, scale);
    if (this.spot) this.#spot(now, reduced);
    this.#chefs(state, now, reduced);
    this.effects.draw(context, now, state.current.t, reduced, this.grid[0].length);
  }

  #put(name, x, y, side) {
    this.context.drawImage(this.sprites.at(name, side * this.cellPixels / CELL), x, y, side, side);
  }

  #pots(state, now, reduced) {
    const full = new Map(state.current.pots.map((pot) => [`${pot[0]},${pot[1]}`, pot]));
    this.grid.forEach((row, y) => [...row].forEach((tile, x) => {
      if (tile === 'P') this.#pot(full.get(`${x},${y}`) ?? [x, y, 0, -1], state, now, reduced);
    }));
  }

  #pot(pot, state, now, reduced) {
    const [x, y, onions, tick] = pot;
    const cooking = tick >= 0;
    const name = tick >= COOK_TIME ? 'pot-ready' : cooking ? 'pot-cooking' : onions ? `pot-${onions}` : 'pot-empty';
    contactShadow(this.context, x * CELL + 32, y * CELL + 57, 25);
    this.#put(name, x * CELL + 2, y * CELL + 1, CELL - 4);
    const alive = !reduced && state.phase === 'playing' && state.link === 'open';
    if (cooking && alive) potLife(this.context, pot, now);
    if (cooking && tick < COOK_TIME) {
      const glide = alive ? Math.min(1, (now - state.arrivedMs) / state.game.tick_ms) : 0;
      this.#ring(x * CELL + RING.x, y * CELL + RING.y, Math.min(1, (tick + glide) / COOK_TIME));
    }
  }

  #ring(x, y, part) {
    const context = this.context;
    const arc = (radius, to) => { context.beginPath(); context.arc(x, y, radius, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * to); };
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

  #items(state, now, reduced) {
    for (const [x, y, item] of state.current.counters) {
      const age = now - (this.landed.get(`${x},${y}`) ?? -1e9);
      const lift = reduced || age > PUT_MS ? 0 : 1 - age / PUT_MS;
      const side = 40 * (1 + 0.22 * lift);
      contactShadow(this.context, x * CELL + 32, y * CELL + 43, 15);
      this.#put(`item-${ITEMS[item]}`, x * CELL + 32 - side / 2, y * CELL + 25 - side / 2 - 10 * lift, side);
    }
  }

  #marks(state, now, reduced, scale) {
    const { watched_seat: watched, seat, tick_ms: tickMs } = state.game;
    const age = now - state.arrivedMs;
    const who = isStale(state.arrivedMs, now, tickMs) ? 'stale' : watched === seat ? 'human' : 'partner';
    const list = eased(state.marks, state.marksBefore, age, reduced);
    for (let i = list.length - 1; i >= 0; i -= 1) drawMark(this.context, this.sprites, list[i], who, scale);
  }

  /** The ring round a place that the tutorial points at. */
  #spot(now, reduced) {
    const [x, y] = this.spot;
    const context = this.context;
    const beat = reduced ? 0 : 1.5 * Math.sin(now / 260);
    for (const [paint, width] of [['#ffffff', 7], [colour('--accent'), 4]]) {
      context.strokeStyle = paint;
      context.lineWidth = width;
      rounded(context, x * CELL + 4.5 - beat, y * CELL + 3.5 - beat, CELL - 9 + 2 * beat, CELL - 7 + 2 * beat);
      context.stroke();
    }
  }

  #chefs(state, now, reduced) {
    const { seat: own } = state.game;
    const order = state.current.players.map((_, seat) => seat)
      .map((seat) => ({ seat, at: reduced ? state.current.players[seat] : place(state, seat, now) }))
      .sort((a, b) => a.at[1] - b.at[1] || a.seat - b.seat);
    const chefs = order.map(({ seat, at }) => ({
      who: own === seat || (own < 0 && seat === 0) ? 'blue' : 'green',
      x: at[0], y: at[1], facing: facing(state, seat), held: state.current.players[seat][3],
      motion: reduced || state.phase !== 'playing' ? null : motion(state, seat, now),
      isOwn: own === seat, cellPixels: this.cellPixels,
    }));
    for (const chef of chefs) drawChef(this.context, this.sprites, chef);
    for (const chef of chefs) if (chef.isOwn && this.youText) drawTag(this.context, this.youText, chef, this.tagScale);
  }
}

/** The path of a rectangle with round corners. `roundRect` is missing in browsers of 2022. */
function rounded(context, left, top, width, height, radius = 12) {
  const corners = [[left + width, top], [left + width, top + height], [left, top + height], [left, top]];
  context.beginPath();
  context.moveTo(left + width / 2, top);
  corners.forEach(([x, y], k) => {
    const [nextX, nextY] = corners[(k + 1) % 4];
    context.arcTo(x, y, (x + nextX) / 2, (y + nextY) / 2, radius);
  });
  context.closePath();
}

/** How a chef moves within this tick, for its bounce: {kind: 'walk' | 'bump' | 'use' | 'rest', part 0..1, now}. */
function motion(state, seat, now) {
  const [x, y] = state.current.players[seat];
  const [fromX, fromY] = state.from[seat] ?? [x, y];
  const part = progress(state, now);
  const action = state.actions[seat];
  const walking = Math.abs(x - fromX) + Math.abs(y - fromY) > 0.01;
  const kind = walking ? 'walk' : action < 4 ? 'bump' : action === 5 ? 'use' : 'rest';
  return { kind: state.previous ? kind : 'rest', part, now, stride: state.current.t % 2 ? 1 : -1 };
}
