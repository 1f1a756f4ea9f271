// The page's texts: a catalogue that the server puts into the page, filled in with numbers or small elements (keys).

/** @typedef {Record<string, string | number>} Values */
/** @typedef {(key: string, values?: Values) => string} Translate */
/** @typedef {(key: string, values?: Record<string, string | Node>) => (string | Node)[]} TranslateToNodes */
/** @typedef {Translate & { nodes: TranslateToNodes }} Catalogue */

/**
 * Return text(key, values): the text with each `{name}` replaced. A missing key shows as itself.
 * @param {Record<string, string>} texts
 * @returns {Catalogue}
 */
export function catalogue(texts) {
  /** @type {Translate} */
  const text = (key, values = {}) => fillIn(texts[key] ?? key, values);
  // A text may name the same key twice, and a node has only one place on the page.
  /** @type {(value: string | Node) => string | Node} */
  const copied = (value) => (typeof value === 'string' ? value : value.cloneNode(true));
  /** @type {Catalogue['nodes']} */
  const nodes = (key, values = {}) =>
    (texts[key] ?? key)
      .split(/(\{\w+\})/)
      .filter(Boolean)
      .map((piece) => (piece.startsWith('{') ? copied(values[piece.slice(1, -1)] ?? piece) : piece));
  return Object.assign(text, { nodes });
}

/**
 * Replace each `{name}` in a text.
 * @param {string} template
 * @param {Record<string, unknown>} values
 * @returns {string}
 */
export function fillIn(template, values) {
  return template.replace(/\{(\w+)\}/g, (whole, name) => String(values[name] ?? whole));
}

/**
 * Return the JSON in `<script type="application/json" id=...>`.
 * @param {string} id
 * @returns {any}
 */
export function jsonBlock(id) {
  const block = document.getElementById(id);
  if (!block) throw new Error(`the page has no JSON block ${id}`);
  return JSON.parse(block.textContent ?? '');
}
