// The YAML side of the study builder: line numbers, and marks at the lines with problems.

import { find } from '../browser/dom.js';
import { make } from './elements.js';

/** @typedef {import('./builder-requests.js').Problem} Problem */

export class YamlPane {
  /** @param {(text: string) => void} typed */
  constructor(typed) {
    this.area = find('#yaml', HTMLTextAreaElement);
    this.gutter = find('#gutter', HTMLElement);
    /** @type {Problem[]} */
    this.problems = [];
    this.area.addEventListener('input', () => {
      this.number();
      typed(this.area.value);
    });
    this.area.addEventListener('scroll', () => {
      this.gutter.scrollTop = this.area.scrollTop;
    });
  }

  /**
   * Show a text; the cursor stays with the words at which it is.
   * @param {string} text
   */
  show(text) {
    const before = this.area.value;
    if (before === text) return;
    const { selectionStart, selectionEnd, scrollTop, scrollLeft } = this.area;
    this.area.value = text;
    const grown = text.length - before.length;
    const same = sameAtTheEnd(before, text);
    const [start, end] = [selectionStart, selectionEnd].map((at) => (before.length - at > same ? at : at + grown));
    this.area.setSelectionRange(start, end);
    this.area.scrollTop = scrollTop;
    this.area.scrollLeft = scrollLeft;
    this.number();
  }

  /** @param {Problem[]} problems */
  mark(problems) {
    this.problems = problems;
    this.number();
  }

  number() {
    const count = this.area.value.split('\n').length;
    const kinds = new Map(this.problems.map((one) => [one.line, one.warning ? 'warn' : 'bad']));
    for (const one of this.problems) if (!one.warning) kinds.set(one.line, 'bad');
    const shown = JSON.stringify([count, [...kinds]]);
    if (this.gutter.dataset.shown === shown) return;
    this.gutter.dataset.shown = shown;
    const lines = Array.from({ length: count }, (_, index) =>
      make('i', { text: index + 1, className: kinds.get(index + 1) }),
    );
    this.gutter.replaceChildren(...lines);
    this.gutter.scrollTop = this.area.scrollTop;
  }

  /**
   * Put the cursor into a line.
   * @param {number} line from 1
   */
  goTo(line) {
    const lines = this.area.value.split('\n');
    const at = lines.slice(0, line - 1).reduce((sum, words) => sum + words.length + 1, 0);
    this.area.focus();
    this.area.setSelectionRange(at, at + (lines[line - 1]?.length ?? 0));
    this.scrollTo(line);
  }

  /** @param {number} line from 1 */
  scrollTo(line) {
    const height = Number.parseFloat(getComputedStyle(this.area).lineHeight);
    this.area.scrollTop = Math.max(0, (line - 5) * height);
  }
}

/**
 * How many characters at the end are the same.
 * @param {string} one
 * @param {string} other
 */
function sameAtTheEnd(one, other) {
  const most = Math.min(one.length, other.length);
  let count = 0;
  while (count < most && one[one.length - 1 - count] === other[other.length - 1 - count]) count++;
  return count;
}
