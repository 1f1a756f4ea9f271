// One field of the study builder: a label, an input, its description, and its problems.

import { make, withCode } from './elements.js';

/** @typedef {import('./builder-plan.js').PlanNode} PlanNode */
/** @typedef {import('./builder-session.js').Operation} Operation */
/** @typedef {HTMLInputElement | HTMLTextAreaElement | HTMLSelectElement} Control */
/**
 * @typedef {object} FieldContext
 * @property {(operation: Operation) => void} change
 * @property {string[]} languages of the study
 * @property {(path: (string | number)[]) => string[]} suggestions
 * @property {(words: string) => Promise<string>} markdown
 */

const LONG = 60; // characters, from which on a text gets several lines
const TRUE = /^(true|yes|on|1)$/i;
const MARKDOWN = /(^|,)(body|lead)(,|$)/;
const PREVIEW_MS = 250;
let count = 0;

/**
 * Return the element of a field.
 * @param {PlanNode} node
 * @param {FieldContext} context
 * @returns {HTMLElement}
 */
export function fieldOf(node, context) {
  if (node.kind === 'words') return wordsOf(node, context);
  if (node.kind === 'unknown') return unknownOf(node);
  const control = controlOf(node, context);
  const label = make('label', { text: node.label, for: control.id });
  const parts = node.kind === 'switch' ? [make('span', { className: 'tick' }, control, label)] : [label, control];
  return framed(node, parts, [control]);
}

/**
 * @param {PlanNode} node
 * @param {Node[]} parts
 * @param {Control[]} controls
 */
function framed(node, parts, controls) {
  const field = make('div', { className: 'field', 'data-path': keyOf(node.path) }, ...parts);
  const wrong = make('p', { className: 'wrong', id: `field-${++count}`, hidden: '' });
  field.append(wrong);
  if (node.help) field.append(helpOf(node.help + typeOf(node) + exampleOf(node)));
  for (const control of controls) control.setAttribute('aria-describedby', wrong.id);
  return field;
}

/**
 * Return a key's description.
 * @param {string} help
 */
export function helpOf(help) {
  return make('p', { className: 'help' }, ...withCode(help));
}

/**
 * Return the type of a number or a list in words; other fields show theirs.
 * @param {PlanNode} node
 */
function typeOf({ kind, schema }) {
  const numbers = { integer: 'Whole number', number: 'Number' };
  if (kind === 'number') return ` ${numbers[/** @type {'integer' | 'number'} */ (schema.type)]}${limitsOf(schema)}.`;
  if (kind !== 'names') return '';
  return ` ${schema.items?.type === 'integer' ? 'Whole numbers' : 'Names'}, separated by commas.`;
}

/** @param {import('./builder-plan.js').Schema} schema of a number */
function limitsOf({ minimum, maximum, exclusiveMinimum, exclusiveMaximum }) {
  if (minimum !== undefined && maximum !== undefined) return ` from ${minimum} to ${maximum}`;
  const words = [
    exclusiveMinimum === undefined ? '' : `more than ${exclusiveMinimum}`,
    minimum === undefined ? '' : `at least ${minimum}`,
    !(exclusiveMaximum < Number.MAX_SAFE_INTEGER) ? '' : `less than ${exclusiveMaximum}`,
    maximum === undefined ? '' : `at most ${maximum}`,
  ];
  return words
    .filter(Boolean)
    .map((one) => `, ${one}`)
    .join('');
}

/**
 * Return what a field may contain, as one would type it; a choice already lists its values.
 * @param {PlanNode} node
 */
function exampleOf({ kind, schema }) {
  const example = schema.examples?.[0];
  if (example === undefined || !['text', 'number', 'names'].includes(kind)) return '';
  return ` For example \`${Array.isArray(example) ? example.join(', ') : example}\`.`;
}

/** @param {(string | number)[]} path */
export function keyOf(path) {
  return JSON.stringify(path);
}

/**
 * @param {PlanNode} node
 * @param {FieldContext} context
 * @returns {Control}
 */
function controlOf(node, context) {
  const id = `field-${++count}`;
  if (node.kind === 'choice') return choiceOf(node, context, id);
  if (node.kind === 'switch') {
    const box = make('input', { type: 'checkbox', id, 'data-control': keyOf(node.path) });
    box.addEventListener('change', () =>
      context.change({ do: 'put', path: node.path, value: String(box.checked), plain: true }),
    );
    return box;
  }
  const isLong = node.kind === 'text' && /grid$/.test(String(node.path.at(-1)));
  const input = isLong
    ? make('textarea', { id, className: 'mono', rows: node.value ? '7' : '2', spellcheck: 'false' })
    : make('input', { id, type: 'text', autocomplete: 'off', spellcheck: 'false' });
  if (node.kind === 'number') input.setAttribute('inputmode', 'decimal');
  input.dataset.control = keyOf(node.path);
  const options = context.suggestions(node.path);
  if (options.length) {
    const list = make('datalist', { id: `${id}-list` }, ...options.map((value) => make('option', { value })));
    input.setAttribute('list', list.id);
    queueMicrotask(() => input.after(list));
  }
  input.addEventListener('input', () => context.change(changeOf(node, input.value)));
  return input;
}

/**
 * Return the change for a field's text: an empty optional field removes the key.
 * @param {PlanNode} node
 * @param {string} words
 * @returns {Operation}
 */
function changeOf(node, words) {
  const { path } = node;
  if (words === '' && !node.required) return { do: 'put', path, value: null }; // becomes `remove` in the session
  if (node.kind === 'names') {
    const plain = node.schema.anyOf?.find((/** @type {any} */ one) => one.enum)?.enum ?? [];
    if (plain.includes(words)) return { do: 'put', path, value: words };
    const isNumber = node.schema.items?.type === 'integer';
    const items = words.split(/[,，]/).map((word) => word.trim());
    const given = items.filter(Boolean).map((word) => (isNumber && /^\d+$/.test(word) ? Number(word) : word));
    return { do: 'put', path, value: given };
  }
  return { do: 'put', path, value: words, plain: node.kind === 'number' };
}

/**
 * @param {PlanNode} node
 * @param {FieldContext} context
 * @param {string} id
 */
function choiceOf(node, context, id) {
  const select = make('select', { id, 'data-control': keyOf(node.path) });
  const options = node.options.map((value) => make('option', { value, text: value }));
  if (!node.required)
    select.append(make('option', { value: '', text: node.initial ? `${node.initial} (default)` : 'not set' }));
  select.append(...options);
  select.addEventListener('change', () => context.change(changeOf(node, select.value)));
  return select;
}

/** @param {PlanNode} node */
function unknownOf(node) {
  const words = 'The form cannot show this value. Edit it in the YAML.';
  return framed(node, [make('span', { className: 'label', text: node.label }), make('p', { text: words })], []);
}

/**
 * A text with a field for each language.
 * @param {PlanNode} node
 * @param {FieldContext} context
 */
function wordsOf(node, context) {
  const isPlain = typeof node.value === 'string';
  const there = node.value && typeof node.value === 'object' ? Object.keys(node.value) : [];
  const languages = isPlain ? [''] : [...new Set([...context.languages, ...there])];
  const name = make('span', { className: 'label', text: node.label });
  const rows = make('div', { className: 'words' });
  const controls = languages.map((language) => {
    const [row, control] = languageRow(node, language, context);
    rows.append(row);
    return control;
  });
  if (isPlain && context.languages.length > 1) {
    const split = make('button', { className: 'btn tiny', type: 'button', text: 'One text for each language' });
    split.addEventListener('click', () => {
      const value = Object.fromEntries(context.languages.map((language) => [language, String(node.value)]));
      context.change({ do: 'put', path: node.path, value });
    });
    rows.append(make('div', {}, make('span', {}), make('span', {}, split)));
  }
  return framed(node, [name, rows], controls);
}

/**
 * @param {PlanNode} node
 * @param {string} language empty: all of them
 * @param {FieldContext} context
 * @returns {[HTMLElement, HTMLInputElement | HTMLTextAreaElement]}
 */
function languageRow(node, language, context) {
  const path = language ? [...node.path, language] : node.path;
  const words = String((language ? node.value?.[language] : node.value) ?? '');
  const isMarkdown = MARKDOWN.test(String(node.path));
  const label = `${node.label}${language ? ` (${language})` : ''}`;
  const control =
    isMarkdown || words.length > LONG || words.includes('\n')
      ? make('textarea', { 'aria-label': label })
      : make('input', { type: 'text', autocomplete: 'off', 'aria-label': label });
  if (language) control.lang = language;
  control.dataset.control = keyOf(path);
  const row = make('div', {}, make('span', { className: 'lang', text: language || 'all' }), control);
  const preview = isMarkdown ? previewOf(row, language, context) : null;
  control.addEventListener('input', () => {
    context.change(wordsChange(node, path, control));
    preview?.(control.value);
  });
  if (preview) control.addEventListener('shown', () => preview(control.value));
  return [row, control];
}

/**
 * An empty text of one language leaves the text; if all are empty, the key goes, unless it must be there.
 * @param {PlanNode} node
 * @param {(string | number)[]} path
 * @param {HTMLInputElement | HTMLTextAreaElement} control
 * @returns {Operation}
 */
function wordsChange(node, path, control) {
  if (control.value) return { do: 'put', path, value: control.value };
  const all = [...(control.closest('.words')?.querySelectorAll('input, textarea') ?? [])];
  const isEmpty = all.every((one) => /** @type {HTMLInputElement} */ (one).value === '');
  if (isEmpty && node.required) return { do: 'put', path, value: '' };
  return { do: 'put', path: isEmpty ? node.path : path, value: null };
}

/**
 * Show a Markdown text as participants will see it.
 * @param {HTMLElement} row
 * @param {string} language
 * @param {FieldContext} context
 */
function previewOf(row, language, context) {
  const shown = make('div', { className: 'markdown', lang: language || undefined });
  row.append(shown);
  let timer = 0;
  let last = '';
  return (/** @type {string} */ words) => {
    if (words === last) return;
    last = words;
    clearTimeout(timer);
    timer = setTimeout(async () => {
      const html = words ? await context.markdown(words) : '';
      if (words === last) shown.innerHTML = html; // rendered by the server, which escapes all HTML in it
    }, PREVIEW_MS);
  };
}

/**
 * Put a value into a control, unless somebody is typing in it.
 * @param {Control} control
 * @param {PlanNode} node
 * @param {any} value
 * @param {boolean} isWaiting whether a newer value is on its way into the text
 */
export function show(control, node, value, isWaiting) {
  if (control instanceof HTMLInputElement && control.type === 'checkbox') {
    if (!isWaiting) control.checked = TRUE.test(String(value ?? node.initial ?? false));
    return;
  }
  const words = Array.isArray(value) ? value.join(', ') : String(value ?? '');
  if (!(control instanceof HTMLSelectElement)) {
    const initial = Array.isArray(node.initial) ? node.initial.join(', ') : node.initial;
    control.placeholder = node.kind !== 'words' && initial !== undefined && initial !== null ? String(initial) : '';
  } else if (words && ![...control.options].some((one) => one.value === words)) {
    control.append(make('option', { value: words, text: words })); // an invalid value is shown as it is in the text
  }
  const isTyped = document.activeElement === control && (isWaiting || same(control, node, words));
  if (!isTyped && !isWaiting && control.value !== words) control.value = words;
  control.dispatchEvent(new Event('shown'));
}

/**
 * Whether what is typed already means the same as the text ("a, " means "a").
 * @param {Control} control
 * @param {PlanNode} node
 * @param {string} words
 */
function same(control, node, words) {
  return node.kind === 'names' && control.value.replace(/[\s,]+/g, ',').replace(/,$/, '') === words.replace(/\s/g, '');
}
