// Texts that lack a language: marked at their fields, counted for each language, and found one after the other.

import { focusInside } from './builder-open-blocks.js';
import { make } from './elements.js';

/** @typedef {import('./builder-plan.js').PlanNode} PlanNode */
/** @typedef {import('./builder-fields.js').Control} Control */

export class MissingTexts {
  /** @param {HTMLElement} place of the counts */
  constructor(place) {
    this.place = place;
    /** @type {Map<string, Control[]>} */
    this.found = new Map();
    this.last = /** @type {Control | null} */ (null);
  }

  /**
   * Mark the fields of a form, and count.
   * @param {PlanNode} plan
   * @param {string[]} languages
   * @param {(path: (string | number)[]) => Control | undefined} controlAt
   */
  show(plan, languages, controlAt) {
    const found = new Map(languages.map((language) => [language, /** @type {Control[]} */ ([])]));
    for (const node of textsOf(plan)) {
      for (const language of languages) {
        const control = controlAt([...node.path, language]);
        if (!control) continue;
        const isMissing = lacks(node, language);
        mark(control, language, isMissing);
        if (isMissing) found.get(language)?.push(control);
      }
    }
    this.found = found;
    const missing = languages.filter((language) => found.get(language)?.length);
    this.place.hidden = missing.length === 0;
    for (const language of languages) this.showCount(language, found.get(language)?.length ?? 0);
  }

  /**
   * The button of a language, which stays while it has the focus.
   * @param {string} language
   * @param {number} count
   */
  showCount(language, count) {
    const old = [...this.place.querySelectorAll('button')].find((one) => one.dataset.language === language);
    const button = old ?? make('button', { className: 'btn tiny', type: 'button', 'data-language': language });
    if (!old) {
      button.addEventListener('click', () => this.goOn(language));
      this.place.append(button);
    }
    button.hidden = count === 0;
    button.textContent = `${language}: ${count} ${count === 1 ? 'text is' : 'texts are'} missing. Show the next`;
  }

  /** @param {string} language */
  goOn(language) {
    const fields = this.found.get(language) ?? [];
    const next = fields[(fields.indexOf(/** @type {Control} */ (this.last)) + 1) % fields.length];
    if (!next) return;
    this.last = next;
    focusInside(next);
  }
}

/**
 * Whether a text that is there has no words in this language. A text that is not a block is the same in all.
 * @param {PlanNode} node
 * @param {string} language
 */
function lacks({ value }, language) {
  return Boolean(value) && typeof value === 'object' && !value[language];
}

/**
 * @param {Control} control
 * @param {string} language
 * @param {boolean} isMissing
 */
function mark(control, language, isMissing) {
  const row = control.parentElement;
  const label = row?.querySelector('.lang');
  row?.classList.toggle('missing', isMissing);
  if (label) label.textContent = isMissing ? `${language}: missing` : language;
  const name = String(control.getAttribute('aria-label')).replace(/, missing$/, '');
  control.setAttribute('aria-label', isMissing ? `${name}, missing` : name);
}

/**
 * @param {PlanNode} node
 * @returns {PlanNode[]} all texts below it, in the order of the form
 */
function textsOf(node) {
  return node.kind === 'words' ? [node] : node.children.flatMap(textsOf);
}
