// The form of the study builder: sections with fields made from the schema, kept equal to the values in the text.

import { root } from '../browser/addresses.js';
import { find, findAll } from '../browser/dom.js';
import { fieldOf, helpOf, keyOf, show } from './builder-fields.js';
import { listOf, mapOf } from './builder-items.js';
import { drawButton, isKitchen, titleFor } from './builder-kitchens.js';
import { offersOf } from './builder-offers.js';
import { openAfter } from './builder-open-blocks.js';
import { placeForModels, showOwnModels } from './builder-own-models.js';
import { blank, planOf, shapeOf } from './builder-plan.js';
import { blockAt, showProblems } from './builder-problems.js';
import { MissingTexts } from './builder-translations.js';
import { make } from './elements.js';

/** @typedef {import('./builder-plan.js').PlanNode} PlanNode */
/** @typedef {import('./builder-plan.js').Schema} Schema */
/** @typedef {import('./builder-fields.js').Control} Control */
/** @typedef {import('./builder-own-models.js').OwnModels} OwnModels */
/** @typedef {import('./builder-requests.js').Problem} Problem */
/** @typedef {import('./builder-session.js').Operation} Operation */
/** @typedef {{ name: string, title: string, keys: string[] }} Section of a file, from server/study/sections.py */

const SHORT = ['number', 'choice', 'switch'];

export class DraftForm {
  /**
   * @param {Schema} schema
   * @param {Section[]} sections in the order of the form
   * @param {{ change(operation: Operation): void, waits(path: (string | number)[]): boolean,
   *   suggestions(path: (string | number)[], values: any): string[], markdown(words: string): Promise<string>,
   *   draw(path: (string | number)[], kitchen: any): void, offers: import('./builder-offers.js').Offers }} on
   */
  constructor(schema, sections, on) {
    this.schema = schema;
    this.sections = sections;
    this.on = on;
    this.place = find('#form', HTMLElement);
    this.missing = new MissingTexts(find('#missing-texts', HTMLElement));
    this.shape = '';
    this.values = {};
    /** @type {string[]} */
    this.languages = ['en'];
    this.opened = new Set(['section 0', 'section 1']);
    this.focusNext = '';
    /** @type {HTMLInputElement | null} the first field of an item that was just added */
    this.added = null;
    /** @type {Map<string, Control>} */
    this.controls = new Map();
  }

  /**
   * Show the values of a text; null: it cannot be read, so the form waits.
   * @param {any} values
   * @param {Problem[]} problems
   * @param {OwnModels} own what was trained here
   */
  show(values, problems, own) {
    this.place.inert = values === null;
    const words = values === null ? 'correct the YAML to use the form' : 'grey: the default if a field is empty';
    find('#form-note', HTMLElement).textContent = words;
    if (values === null) return;
    this.values = values;
    const languages = Array.isArray(values.languages) ? values.languages : [];
    this.languages = languages.every((/** @type {any} */ one) => typeof one === 'string') ? languages : [];
    if (this.languages.length === 0) this.languages = ['en'];
    const plan = planOf(this.schema, this.schema, values, [], true);
    const shape = JSON.stringify([this.languages, shapeOf(plan)]);
    if (shape !== this.shape) this.build(plan);
    this.shape = shape;
    this.fill(plan);
    this.added?.select(); // typing replaces the name that a new item was given
    this.added = null;
    this.missing.show(plan, this.languages, (path) => this.controls.get(keyOf(path)));
    showProblems(this.place, problems, this.on.change);
    showOwnModels(this.place, values, own, (path, value) => this.on.change({ do: 'put', path, value }));
  }

  /** @param {PlanNode} plan */
  build(plan) {
    const active = document.activeElement instanceof HTMLElement ? document.activeElement : null;
    const focus = this.focusNext || active?.dataset.control || '';
    const selection =
      active instanceof HTMLInputElement || active instanceof HTMLTextAreaElement ? active.selectionStart : null;
    const sections = this.sections.map((section) => ({ section, nodes: pick(plan.children, section.keys) }));
    const shown = sections.filter(({ nodes }) => nodes.length > 0);
    this.place.replaceChildren(...shown.map(({ section, nodes }, index) => this.sectionOf(section, nodes, index)));
    this.controls = new Map(
      findAll('[data-control]', HTMLElement, this.place).map((one) => [
        String(one.dataset.control),
        /** @type {Control} */ (one),
      ]),
    );
    this.restoreFocus(focus, selection);
    this.focusNext = '';
  }

  /**
   * @param {string} focus what has the focus: a control, or the block whose first control gets it
   * @param {number | null} selection
   */
  restoreFocus(focus, selection) {
    if (!focus) return;
    let target = this.controls.get(focus);
    const block = target ? null : this.place.querySelector(`[data-path='${CSS.escape(focus).replaceAll('\\', '\\')}']`);
    if (block) {
      for (let up = block.closest('details'); up; up = up.parentElement?.closest('details') ?? null) up.open = true;
      target =
        /** @type {Control | null} */ (block.querySelector('.inside [data-control], [data-control]')) ?? undefined;
    }
    if (!target) return;
    target.focus();
    if (block && target instanceof HTMLInputElement) this.added = target;
    if (selection !== null && (target instanceof HTMLInputElement || target instanceof HTMLTextAreaElement)) {
      if (target.type === 'text' || target.type === 'textarea') target.setSelectionRange(selection, selection);
    }
  }

  /**
   * @param {Section} section
   * @param {PlanNode[]} nodes
   * @param {number} index
   */
  sectionOf({ name, title }, nodes, index) {
    const alone = nodes.length === 1 && nodes[0]?.kind === 'group' && !nodes[0].schema.isOptional;
    const inside = alone ? this.insideOf(nodes[0]?.children ?? []) : this.insideOf(nodes);
    const href = `${root}/admin/study-keys/${name}`;
    const words = `All keys of “${title}”: type, default, example, meaning`;
    inside.append(make('p', { className: 'all-keys' }, make('a', { href, target: '_blank', text: words })));
    return this.details(`section ${index}`, title, inside);
  }

  /**
   * @param {string} key
   * @param {string} title
   * @param {HTMLElement} inside
   */
  details(key, title, inside) {
    const summary = make('summary', {}, make('span', { className: 'title', text: title }));
    summary.append(make('span', { className: 'badge bad', hidden: '' }));
    const details = make('details', {}, summary, inside);
    details.open = this.opened.has(key);
    details.addEventListener('toggle', () => (details.open ? this.opened.add(key) : this.opened.delete(key)));
    return details;
  }

  /** @param {PlanNode[]} nodes */
  insideOf(nodes) {
    const inside = make('div', { className: 'inside' });
    /** @type {HTMLElement | null} */
    let row = null;
    for (const node of nodes) {
      if (!SHORT.includes(node.kind)) row = null;
      else if (!row) inside.append((row = make('div', { className: 'short' })));
      (row ?? inside).append(this.elementOf(node));
    }
    return inside;
  }

  /**
   * @param {PlanNode} node
   * @returns {HTMLElement}
   */
  elementOf(node) {
    if (node.kind === 'list') return listOf(node, this.context());
    if (node.kind === 'map') return mapOf(node, this.context());
    if (node.kind === 'group') return node.children.length ? this.blockOf(node) : this.adderOf(node);
    const field = fieldOf(node, {
      change: (operation) => this.on.change(operation),
      languages: this.languages,
      suggestions: (path) => this.on.suggestions(path, this.values),
      markdown: (words) => this.on.markdown(words),
    });
    const offers = offersOf(node.path, this.on.offers, (value) => this.choose(node.path, value));
    field.append(...[placeForModels(node.path) ?? offers].filter((one) => one !== null));
    return field;
  }

  /**
   * Write a name that was offered. A kitchen without a title is called by it, as one that is drawn from here.
   * @param {(string | number)[]} path
   * @param {string} value
   */
  choose(path, value) {
    this.on.change({ do: 'put', path, value });
    const block = path.slice(0, -1);
    const title = isKitchen(block) ? this.valueAt(block)?.title : undefined;
    if (!title || typeof title !== 'object' || Object.values(title).some(Boolean)) return;
    this.on.change({ do: 'put', path: [...block, 'title'], value: titleFor(value, this.languages) });
  }

  /** @param {(string | number)[]} path */
  valueAt(path) {
    return path.reduce((value, key) => value?.[key], /** @type {any} */ (this.values));
  }

  context() {
    return {
      root: this.schema,
      languages: this.languages,
      act: (/** @type {Operation} */ operation, focus = '') => {
        this.focusNext = focus;
        const moved = openAfter(this.opened, operation);
        if (moved) {
          this.opened = moved;
          this.shape = ''; // build it again
        }
        this.on.change(operation);
      },
      elementOf: (/** @type {PlanNode} */ node) => this.elementOf(node),
      blockOf: (/** @type {PlanNode} */ node) => this.blockOf(node),
      draw: (/** @type {PlanNode} */ node) => this.on.draw(node.path, undefined),
    };
  }

  /** @param {PlanNode} node */
  blockOf(node) {
    const isItem = typeof node.path.at(-1) === 'number';
    const title = isItem ? titleOf(node) : node.label;
    const inside = node.kind === 'group' ? this.insideOf(node.children) : make('div', {}, this.elementOf(node));
    inside.className = 'inside';
    if (node.help && !isItem) inside.prepend(helpOf(node.help));
    inside.prepend(make('p', { className: 'wrong', hidden: '' }));
    const details = this.details(keyOf(node.path), title, inside);
    details.classList.add('group');
    details.dataset.path = keyOf(node.path);
    if (isKitchen(node.path)) {
      const open = () => this.on.draw(node.path, this.valueAt(node.path));
      inside.append(make('div', {}, drawButton('Draw this kitchen…', `draw ${keyOf(node.path)}`, open)));
    }
    if (node.schema.isOptional) inside.append(this.removerOf(node));
    return details;
  }

  /** @param {PlanNode} node */
  adderOf(node) {
    const words = `Add: ${node.label.toLowerCase()}`;
    const button = make('button', { className: 'btn tiny', type: 'button', text: words });
    button.dataset.control = `add ${keyOf(node.path)}`;
    button.addEventListener('click', () => {
      this.focusNext = keyOf(node.path);
      this.on.change({ do: 'put', path: node.path, value: blank(this.schema, node.schema, this.languages) });
    });
    const field = make('div', { className: 'field', 'data-path': keyOf(node.path) }, make('div', {}, button));
    field.append(make('p', { className: 'wrong', hidden: '' }));
    if (node.help) field.append(helpOf(node.help));
    return field;
  }

  /** @param {PlanNode} node */
  removerOf(node) {
    const button = make('button', { className: 'btn tiny danger', type: 'button' });
    button.textContent = `Remove: ${node.label.toLowerCase()}`;
    button.addEventListener('click', () => this.on.change({ do: 'remove', path: node.path }));
    return make('div', {}, button);
  }

  /** @param {PlanNode} node */
  fill(node) {
    if (node.kind === 'words') {
      for (const language of typeof node.value === 'string'
        ? []
        : [...this.languages, ...Object.keys(node.value ?? {})]) {
        this.fillOne([...node.path, language], node, node.value?.[language]);
      }
    }
    if (node.kind !== 'words' || typeof node.value === 'string') this.fillOne(node.path, node, node.value);
    const isItem = typeof node.path.at(-1) === 'number';
    const title = isItem ? blockAt(this.place, node.path)?.querySelector(':scope > summary > .title') : null;
    if (title) title.textContent = titleOf(node);
    node.children.forEach((child) => this.fill(child));
  }

  /**
   * @param {(string | number)[]} path
   * @param {PlanNode} node
   * @param {any} value
   */
  fillOne(path, node, value) {
    const control = this.controls.get(keyOf(path));
    if (control) show(control, node, value, this.on.waits(path) || this.on.waits(node.path));
  }
}

/**
 * @param {PlanNode[]} nodes
 * @param {string[]} keys
 */
function pick(nodes, keys) {
  return keys.flatMap((key) => nodes.filter((node) => node.path[0] === key));
}

/** @param {PlanNode} node */
function titleOf(node) {
  const { value } = node;
  const words = value?.name ?? value?.key ?? value?.title ?? value?.label ?? value?.text ?? value?.value;
  const text = words && typeof words === 'object' ? Object.values(words)[0] : words;
  const type = typeof value?.type === 'string' ? `, ${value.type}` : '';
  return text ? `${text}${type}` : `${Number(node.path.at(-1)) + 1}`;
}
