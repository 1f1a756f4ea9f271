// Creates elements and writes numbers for the researchers' pages.

/** @typedef {string | number | null} Value */
/** @typedef {{ text?: Value, className?: string, [attribute: string]: Value | undefined }} Parts */

/**
 * Return an element with text, a class, attributes and children. Data from participants are only inserted as text.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Parts} parts
 * @param {(Node | string)[]} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function make(tag, { text, className, ...attributes } = {}, ...children) {
  const element = document.createElement(tag);
  if (text !== undefined && text !== null) element.textContent = String(text);
  if (className) element.className = className;
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== undefined && value !== null) element.setAttribute(name, String(value));
  }
  element.append(...children);
  return element;
}

/**
 * Return a text as nodes: `words` in backquotes are names or commands.
 * @param {string} text
 * @returns {(Node | string)[]}
 */
export function withCode(text) {
  return text.split('`').map((words, index) => (index % 2 ? make('code', { text: words }) : words));
}

/**
 * 75 -> 1:15
 * @param {number} seconds
 */
export function clock(seconds) {
  return `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, '0')}`;
}

/**
 * 0.7843 -> 78.4
 * @param {number} share
 */
export function percent(share) {
  return (100 * share).toFixed(1);
}
