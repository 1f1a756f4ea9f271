// The grid of the kitchen editor on the screen: drawn by the game's renderer, with cursor and marks above it.

/** @import { Cell, Grid, Player } from '../board/kitchen.js' */
/** @import { Sprites } from '../board/sprites.js' */
/** @import { Reach } from './kitchen-findings.js' */

import { SOUTH, cellsOf } from '../board/kitchen.js';
import { Renderer, pixelRatio } from '../board/renderer.js';
import { blank } from '../board/sprites.js';
import { boardState } from '../board/still-board.js';

const SVG = 'http://www.w3.org/2000/svg';
const MAX_CELL = 72; // CSS pixels
const SHARE_OF_HEIGHT = 0.66; // of the window
const MIN_HEIGHT = 200;
const PICTURE_CELL = 128; // pixels: twice the size of the drawings
/** @type {Player} a chef who has no start yet */
const NOWHERE = [-9, -9, SOUTH, 0];

export class KitchenDrawing {
  /**
   * @param {HTMLElement} box as wide as the grid may be
   * @param {HTMLCanvasElement} canvas
   * @param {SVGSVGElement} overlay
   * @param {Sprites} sprites
   */
  constructor(box, canvas, overlay, sprites) {
    this.box = box;
    this.canvas = canvas;
    this.overlay = overlay;
    this.sprites = sprites;
    this.renderer = new Renderer(canvas, sprites, '');
    /** @type {Grid} */
    this.grid = ['XXX', 'X X', 'XXX'];
  }

  /** @param {Grid} grid */
  show(grid) {
    this.grid = grid;
    const width = Math.min(this.box.clientWidth - 16, MAX_CELL * grid[0].length);
    const height = Math.max(MIN_HEIGHT, window.innerHeight * SHARE_OF_HEIGHT);
    this.renderer.fit(grid, width, Math.min(height, MAX_CELL * grid.length));
    paint(this.renderer, grid);
    this.overlay.setAttribute('viewBox', `0 0 ${grid[0].length} ${grid.length}`);
  }

  /**
   * Draw the marks above the grid.
   * @param {Cell} cursor
   * @param {Cell[]} problems
   * @param {Reach | null} reach
   */
  mark(cursor, problems, reach) {
    const marks = problems.map((cell) => rectangle(cell, 'problem', 0.03));
    if (reach) {
      marks.push(...reach.unused.map((cell) => rectangle(cell, 'unused', 0)));
      reach.stations.forEach((cells, chef) => marks.push(...cells.flatMap((cell) => badge(cell, chef + 1))));
      if (!reach.alone.includes(true)) {
        marks.push(...reach.shared.flatMap((cell) => [...badge(cell, 1), ...badge(cell, 2)]));
      }
    }
    marks.push(rectangle(cursor, 'cursor light', 0.06), rectangle(cursor, 'cursor', 0.06));
    this.overlay.replaceChildren(...marks);
  }

  /**
   * Return the cell below a pointer, also a little outside of the grid.
   * @param {PointerEvent} event
   * @returns {Cell}
   */
  cellAt(event) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const [columns, rows] = [this.grid[0].length, this.grid.length];
    const x = Math.floor(((event.clientX - left) / width) * columns);
    const y = Math.floor(((event.clientY - top) / height) * rows);
    return [Math.min(columns - 1, Math.max(0, x)), Math.min(rows - 1, Math.max(0, y))];
  }

  /**
   * Return the grid as a PNG picture.
   * @returns {Promise<Blob | null>}
   */
  picture() {
    const canvas = blank(1, 1);
    const renderer = new Renderer(canvas, this.sprites, '');
    const side = (PICTURE_CELL + 0.01) / pixelRatio();
    renderer.fit(this.grid, side * this.grid[0].length, side * this.grid.length);
    paint(renderer, this.grid);
    return new Promise((done) => canvas.toBlob(done, 'image/png'));
  }
}

/** @type {(renderer: Renderer, grid: Grid) => void} */
function paint(renderer, grid) {
  const now = performance.now();
  /** @type {Player[]} */
  const players = ['1', '2'].map((chef) => {
    const [start] = cellsOf(grid, chef);
    return start ? [...start, SOUTH, 0] : NOWHERE;
  });
  const kitchen = { t: 0, players, counters: [], pots: [], score: 0, soups: 0 };
  const still = { grid, seat: -1, watched_seat: 0, tick_ms: 200, horizon: 0 };
  renderer.draw(boardState(still, kitchen, now), now, true);
}

/** @type {(cell: Cell, className: string, inset: number) => SVGElement} */
function rectangle([x, y], className, inset) {
  return shape('rect', className, {
    ...{ x: x + inset, y: y + inset, width: 1 - 2 * inset, height: 1 - 2 * inset, rx: 0.08 },
  });
}

/** @type {(cell: Cell, chef: number) => SVGElement[]} */
function badge([x, y], chef) {
  const [cx, cy] = [x + (chef === 1 ? 0.18 : 0.82), y + 0.82];
  const number = shape('text', `on-${chef}`, { x: cx, y: cy + 0.075 });
  number.textContent = String(chef);
  return [shape('circle', `chef-${chef}`, { cx, cy, r: 0.15 }), number];
}

/** @type {(tag: string, className: string, attributes: Record<string, number>) => SVGElement} */
function shape(tag, className, attributes) {
  const element = /** @type {SVGElement} */ (document.createElementNS(SVG, tag));
  element.setAttribute('class', className);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}
