// Lists and blocks with keys in the study builder: adding, removing, renaming, and moving by keyboard or by drag.

import { helpOf, keyOf } from './builder-fields.js';
import { drawButton } from './builder-kitchens.js';
import { blank, innerOf, resolved } from './builder-plan.js';
import { make } from './elements.js';

/** @typedef {import('./builder-plan.js').PlanNode} PlanNode */
/** @typedef {import('./builder-plan.js').Schema} Schema */
/** @typedef {import('./builder-session.js').Operation} Operation */
/**
 * @typedef {object} ItemContext
 * @property {Schema} root
 * @property {string[]} languages
 * @property {(operation: Operation, focus?: string) => void} act changes the list; `focus`: what has the focus then
 * @property {(node: PlanNode) => HTMLElement} elementOf
 * @property {(node: PlanNode) => HTMLDetailsElement} blockOf
 * @property {(node: PlanNode) => void} draw draws a kitchen that is added to a list of kitchens
 */

const KEY = /^[a-z][a-z0-9_]{0,39}$/;
/** Short names of settings, as in server/study/factors.py. @type {Record<string, string>} */
const SETTINGS = { prediction: 'predictor', opacity: 'confidence_opacity', steps: 'steps_shown' };
/** @type {Record<string, boolean | number>} */
const VALUES = { on: true, off: false, yes: true, no: false, one: 1, two: 2, three: 3 };
/** @type {Record<string, string>} */
const TYPES = { boolean: 'boolean', number: 'integer' };
/** @type {{ list: string, index: number } | null} */
let dragged = null;

/**
 * A list: each item with buttons to move and remove it.
 * @param {PlanNode} node
 * @param {ItemContext} context
 */
export function listOf(node, context) {
  const items = make('ol', { className: 'items' });
  node.children.forEach((child, index) => items.append(itemOf(node, child, index, context)));
  return framed(node, items, adders(node, context));
}

/**
 * @param {PlanNode} node
 * @param {PlanNode} child
 * @param {number} index
 * @param {ItemContext} context
 */
function itemOf(node, child, index, context) {
  const isBlock = ['group', 'map', 'list'].includes(child.kind);
  const body = isBlock ? context.blockOf(child) : make('div', { className: 'plain' }, context.elementOf(child));
  const grip = make('span', { className: 'grip', 'aria-hidden': 'true', text: '⠿', title: 'Drag to move' });
  const moves = movesOf(node, index, context);
  const item = make('li', {}, body, make('span', { className: 'moves' }, grip, ...moves));
  item.addEventListener('keydown', (event) => {
    const step = event.altKey ? { ArrowUp: -1, ArrowDown: 1 }[event.key] : undefined;
    if (!step) return;
    event.preventDefault();
    event.stopPropagation();
    move(node, index, index + step, context);
  });
  makeDraggable(item, grip, node, index, context);
  return item;
}

/**
 * @param {PlanNode} node
 * @param {number} index
 * @param {ItemContext} context
 */
function movesOf(node, index, context) {
  const place = `${node.label} ${index + 1}`;
  const path = [...node.path, index];
  /** @type {[string, string, boolean, () => void][]} */
  const all = [
    ['up', '↑', index > 0, () => move(node, index, index - 1, context)],
    ['down', '↓', index < node.children.length - 1, () => move(node, index, index + 1, context)],
    ['remove', '×', true, () => context.act({ do: 'remove', path })],
  ];
  return all.map(([name, sign, isPossible, act]) => {
    const words = name === 'remove' ? `Remove ${place}` : `Move ${place} ${name}`;
    const button = make('button', { className: 'btn tiny', type: 'button', 'aria-label': words, title: words }, sign);
    button.dataset.control = `${name} ${keyOf(path)}`;
    button.disabled = !isPossible;
    button.addEventListener('click', act);
    return button;
  });
}

/**
 * @param {PlanNode} node
 * @param {number} index
 * @param {number} to
 * @param {ItemContext} context
 */
function move(node, index, to, context) {
  if (to < 0 || to >= node.children.length) return;
  const name = to < index ? 'up' : 'down';
  context.act({ do: 'move', path: node.path, index, to }, `${name} ${keyOf([...node.path, to])}`);
}

/**
 * @param {HTMLLIElement} item
 * @param {HTMLElement} grip
 * @param {PlanNode} node
 * @param {number} index
 * @param {ItemContext} context
 */
function makeDraggable(item, grip, node, index, context) {
  const list = keyOf(node.path);
  grip.addEventListener('pointerdown', () => (item.draggable = true)); // only by its grip: words can be selected
  item.addEventListener('dragstart', (event) => {
    event.stopPropagation();
    dragged = { list, index };
  });
  item.addEventListener('dragend', () => {
    item.draggable = false;
    dragged = null;
  });
  item.addEventListener('dragover', (event) => {
    if (dragged?.list !== list) return;
    event.preventDefault();
    item.classList.add('over');
  });
  item.addEventListener('dragleave', () => item.classList.remove('over'));
  item.addEventListener('drop', (event) => {
    item.classList.remove('over');
    if (dragged?.list !== list) return;
    event.preventDefault();
    event.stopPropagation();
    if (dragged.index !== index) move(node, dragged.index, index, context);
  });
}

/**
 * Buttons that add an item; of a block with several forms, one of them can be chosen.
 * @param {PlanNode} node
 * @param {ItemContext} context
 */
function adders(node, context) {
  const { root, languages, act } = context;
  const items = resolved(root, node.schema.items ?? { type: 'string' });
  const variants = Object.keys(items.discriminator?.mapping ?? {});
  const chosen = make('select', { 'aria-label': 'Type of the new one' });
  chosen.append(...variants.map((value) => make('option', { value, text: value })));
  const button = make('button', { className: 'btn tiny', type: 'button', text: `Add to ${node.label.toLowerCase()}` });
  button.dataset.control = `add ${keyOf(node.path)}`;
  button.addEventListener('click', () => {
    const value = named(blank(root, node.schema.items ?? { type: 'string' }, languages, chosen.value), node);
    const isFlow = keyOf(node.path) === keyOf(['flow']) && node.children.at(-1)?.value === 'thanks';
    const index = node.children.length - (isFlow ? 1 : 0); // the last page stays the last
    const where = { path: node.path, value };
    const focus = keyOf([...node.path, index]);
    if (Array.isArray(node.value)) act({ do: 'insert', index, ...where }, focus);
    else act({ do: 'put', path: node.path, value: [value] }, focus);
  });
  const more =
    keyOf(node.path) === keyOf(['layouts'])
      ? [drawButton('Draw a new kitchen…', `draw ${keyOf(node.path)}`, () => context.draw(node))]
      : [];
  return make('div', { className: 'add' }, ...(variants.length ? [chosen] : []), button, ...more);
}

/**
 * Give a new item a name that no other has.
 * @param {any} value
 * @param {PlanNode} node
 */
function named(value, node) {
  for (const key of ['name', 'key', 'value']) {
    if (value?.[key] !== '') continue;
    const taken = node.children.map((child) => child.value?.[key]);
    const free = Array.from({ length: taken.length + 1 }, (_, index) => `new_${index + 1}`);
    return { ...value, [key]: free.find((name) => !taken.includes(name)) };
  }
  return value;
}

/**
 * A block whose keys are names, such as the questionnaires.
 * @param {PlanNode} node
 * @param {ItemContext} context
 */
export function mapOf(node, context) {
  const items = make('ol', { className: 'items' });
  for (const child of node.children) {
    const block = context.blockOf(child);
    block.querySelector(':scope > .inside')?.prepend(renamer(child, context));
    const words = `Remove ${child.path.at(-1)}`;
    const button = make('button', { className: 'btn tiny', type: 'button', 'aria-label': words, title: words }, '×');
    button.dataset.control = `remove ${keyOf(child.path)}`;
    button.addEventListener('click', () => context.act({ do: 'remove', path: child.path }));
    items.append(make('li', {}, block, make('span', { className: 'moves' }, button)));
  }
  return framed(node, items, keyAdder(node, context));
}

/**
 * @param {PlanNode} child
 * @param {ItemContext} context
 */
function renamer(child, context) {
  const input = make('input', { type: 'text', autocomplete: 'off', spellcheck: 'false' });
  input.value = String(child.path.at(-1));
  const label = make('label', { text: 'Key, as used in the steps and the data' }, input);
  input.addEventListener('change', () => {
    const key = input.value.trim();
    if (KEY.test(key) && key !== child.path.at(-1)) context.act({ do: 'rename', path: child.path, key });
    else input.value = String(child.path.at(-1));
  });
  return make('div', { className: 'field' }, label);
}

/**
 * What the field and the button say that add an entry with a key.
 * @param {PlanNode} node
 */
function wordsOfNew({ path, label }) {
  if (path[0] === 'factors' && path.length === 1)
    return { example: 'a name, such as prediction', label: 'Name of a new factor', add: 'Add a factor' };
  if (path[0] === 'factors' && path.length === 2)
    return {
      example: 'a name, such as none',
      label: `Name of a new level of ${label}; a factor has at least two`,
      add: 'Add a level (at least two)',
    };
  return { example: 'new_key', label: `Key of a new entry of ${label}`, add: `Add to ${label.toLowerCase()}` };
}

/**
 * @param {PlanNode} node
 * @param {ItemContext} context
 */
function keyAdder(node, context) {
  const words = wordsOfNew(node);
  const input = make('input', { type: 'text', placeholder: words.example, 'aria-label': words.label });
  input.className = 'key-of-new';
  const button = make('button', { className: 'btn tiny', type: 'button', text: words.add });
  button.dataset.control = `add ${keyOf(node.path)}`;
  const add = () => {
    const key = input.value.trim() || `new_${node.children.length + 1}`;
    if (!KEY.test(key) || node.children.some((child) => child.path.at(-1) === key)) {
      input.setAttribute('aria-invalid', 'true');
      input.focus();
      return;
    }
    const path = [...node.path, key];
    context.act({ do: 'put', path, value: valueOfNew(node, key, context) }, keyOf(path));
  };
  button.addEventListener('click', add);
  return make('div', { className: 'add' }, input, button);
}

/**
 * Return the value of a new entry. A level that is called like a value of the setting after which its factor is named
 * sets it: `none` of the factor `prediction`, for example. Otherwise it would change nothing.
 * @param {PlanNode} node
 * @param {string} key
 * @param {ItemContext} context
 */
function valueOfNew(node, key, { root, languages }) {
  const value = blank(root, innerOf(node.schema), languages);
  if (node.path[0] !== 'factors' || node.path.length !== 2) return value;
  const factor = String(node.path[1]);
  const setting = SETTINGS[factor] ?? factor;
  const given = resolved(root, innerOf(node.schema)).properties?.[setting];
  const schema = given ? resolved(root, given) : {};
  const level = schema.enum?.includes(key) ? key : VALUES[key];
  const fits = schema.enum?.includes(key) || (schema.type && schema.type === TYPES[typeof level]);
  return fits ? { ...value, [setting]: level } : value;
}

/**
 * @param {PlanNode} node
 * @param {HTMLElement} items
 * @param {HTMLElement} add
 */
function framed(node, items, add) {
  const label = make('span', { className: 'label', text: node.label });
  const field = make('div', { className: 'field', 'data-path': keyOf(node.path) }, label);
  field.append(make('p', { className: 'wrong', hidden: '' }));
  if (node.help) field.append(helpOf(node.help));
  field.append(items, add);
  return field;
}
