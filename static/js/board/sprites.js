// The drawings: loaded once, rasterised once for each size they are shown in. Knows names, not what they mean.

const CHEFS = ['blue', 'green'].flatMap((who) => ['up', 'down', 'left', 'right'].map((way) => `chef-${who}-${way}`));
export const NAMES = [
  ...CHEFS, 'counter', 'counter-front', 'floor-a', 'floor-b', 'item-dish', 'item-onion', 'item-soup',
  'pot-empty', 'pot-1', 'pot-2', 'pot-3', 'pot-cooking', 'pot-ready', 'station-dish', 'station-onion', 'station-serve',
];

/** An empty canvas of so many device pixels. */
export function blank(width, height) {
  const canvas = document.createElement('canvas');
  canvas.width = Math.max(1, Math.round(width));
  canvas.height = Math.max(1, Math.round(height));
  return canvas;
}

export class Sprites {
  constructor(folder) {
    this.folder = folder;
    this.images = new Map();
    this.rasters = new Map();
  }

  /** Loads all drawings; rejects with the name of one that is not there. */
  async load(names = NAMES) {
    await Promise.all(names.map(async (name) => {
      const image = new Image();
      image.src = `${this.folder}${name}.svg`;
      await image.decode().catch(() => { throw new Error(`the drawing ${name}.svg did not load`); });
      this.images.set(name, image);
    }));
    return this;
  }

  /** The drawing as a canvas of `pixels` x `pixels` device pixels. */
  at(name, pixels) {
    const side = Math.max(1, Math.round(pixels));
    return this.raster(`${name}@${side}`, side, side, (context) => context.drawImage(this.images.get(name), 0, 0, side, side));
  }

  /** Whatever `draw(context)` draws, once; later calls with the same key get the same canvas. */
  raster(key, width, height, draw) {
    let canvas = this.rasters.get(key);
    if (!canvas) {
      canvas = blank(width, height);
      draw(canvas.getContext('2d'));
      this.rasters.set(key, canvas);
    }
    return canvas;
  }

  /** Forgets the rasters: the board has another size now. */
  resized() {
    this.rasters.clear();
  }
}

let palette = null;

/** A colour of tokens.css, e.g. colour('--accent'). */
export function colour(name) {
  palette ??= getComputedStyle(document.documentElement);
  return palette.getPropertyValue(name).trim();
}
