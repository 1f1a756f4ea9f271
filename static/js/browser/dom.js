// Finds elements, and throws an error that names a missing one instead of failing later on null.

/**
 * Return the element that `selector` names. Throws an Error if it is missing or of another type.
 * @template {Element} T
 * @param {string} selector
 * @param {new () => T} type for example HTMLButtonElement
 * @param {ParentNode} root where to look
 * @returns {T}
 */
export function find(selector, type, root = document) {
  const found = root.querySelector(selector);
  if (!(found instanceof type)) throw new Error(`the page has no ${type.name} ${selector}`);
  return found;
}

/**
 * Return all elements that `selector` names; those of another type are left out.
 * @template {Element} T
 * @param {string} selector
 * @param {new () => T} type
 * @param {ParentNode} root
 * @returns {T[]}
 */
export function findAll(selector, type, root = document) {
  return /** @type {T[]} */ ([...root.querySelectorAll(selector)].filter((each) => each instanceof type));
}

/**
 * Return a canvas's drawing context. Throws an Error where the browser has none.
 * @param {HTMLCanvasElement} canvas
 * @param {CanvasRenderingContext2DSettings} [settings]
 * @returns {CanvasRenderingContext2D}
 */
export function context2d(canvas, settings) {
  const context = canvas.getContext('2d', settings);
  if (!context) throw new Error('this browser cannot draw on a canvas');
  return context;
}
