// The drawings: loaded once, rasterised once for each size they are shown in.

import { context2d } from '../browser/dom.js';

const CHEFS = ['blue', 'green'].flatMap((who) => ['up', 'down', 'left', 'right'].map((way) => `chef-${who}-${way}`));
const COUNTERS = ['counter', 'counter-front', 'floor-a', 'floor-b'];
const POTS = ['pot-empty', 'pot-1', 'pot-2', 'pot-3', 'pot-cooking', 'pot-ready'];
const STATIONS = ['station-dish', 'station-onion', 'station-serve'];
const ITEMS = ['item-dish', 'item-onion', 'item-soup'];
export const NAMES = [...CHEFS, ...COUNTERS, ...ITEMS, ...POTS, ...STATIONS];

/**
 * Return an empty canvas of `width` x `height` device pixels.
 * @param {number} width
 * @param {number} height
 */
export function blank(width, height) {
  const canvas = document.createElement('canvas');
  canvas.width = Math.max(1, Math.round(width));
  canvas.height = Math.max(1, Math.round(height));
  return canvas;
}

export class Sprites {
  /** @param {string} folder address of the SVG files, with a slash at its end */
  constructor(folder) {
    this.folder = folder;
    /** @type {Map<string, HTMLImageElement>} */
    this.images = new Map();
    /** @type {Map<string, HTMLCanvasElement>} */
    this.rasters = new Map();
  }

  /** Load all drawings. Rejects with the name of one that is missing. */
  async load(names = NAMES) {
    await Promise.all(names.map((name) => this.#load(name)));
    return this;
  }

  /** @param {string} name */
  async #load(name) {
    const image = new Image();
    image.src = `${this.folder}${name}.svg`;
    await image.decode().catch(() => {
      throw new Error(`the drawing ${name}.svg did not load`);
    });
    this.images.set(name, image);
  }

  /**
   * Return the drawing as a canvas of `pixels` x `pixels` device pixels.
   * @param {string} name
   * @param {number} pixels
   */
  at(name, pixels) {
    const side = Math.max(1, Math.round(pixels));
    return this.raster(`${name}@${side}`, side, side, (context) => {
      const image = this.images.get(name);
      if (!image) throw new Error(`the drawing ${name}.svg is not loaded`);
      context.drawImage(image, 0, 0, side, side);
    });
  }

  /**
   * Return what `draw` draws; it is called once, and later calls with the same key get the same canvas.
   * @param {string} key
   * @param {number} width
   * @param {number} height
   * @param {(context: CanvasRenderingContext2D) => void} draw
   */
  raster(key, width, height, draw) {
    let canvas = this.rasters.get(key);
    if (!canvas) {
      canvas = blank(width, height);
      draw(context2d(canvas));
      this.rasters.set(key, canvas);
    }
    return canvas;
  }

  /** Delete the rasters, because the board has another size now. */
  resized() {
    this.rasters.clear();
  }
}

/** @type {Map<string, string>} */
const palette = new Map();

/**
 * Return a colour of tokens.css.
 * @param {string} name for example --accent
 */
export function colour(name) {
  const known = palette.get(name);
  if (known) return known;
  const value = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  palette.set(name, value);
  return value;
}
