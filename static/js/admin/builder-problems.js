// What is wrong with a draft, at the fields of the study builder's form.

import { findAll } from '../browser/dom.js';
import { keyOf } from './builder-fields.js';
import { focusInside } from './builder-open-blocks.js';
import { make, withCode } from './elements.js';

/** @typedef {import('./builder-requests.js').Problem} Problem */
/** @typedef {(operation: import('./builder-session.js').Operation) => void} Change */

/**
 * Return the field or block at a place of the study.
 * @param {HTMLElement} form
 * @param {(string | number)[]} path
 * @returns {Element | null}
 */
export function blockAt(form, path) {
  return findAll('[data-path]', HTMLElement, form).find((one) => one.dataset.path === keyOf(path)) ?? null;
}

/**
 * Return the innermost field or block that a place of the study is in.
 * @param {HTMLElement} form
 * @param {(string | number)[]} path
 */
function nearestBlock(form, path) {
  return path.map((_, index) => blockAt(form, path.slice(0, path.length - index))).find(Boolean);
}

/**
 * Return the input of a field that a problem is about: of a text that lacks a language, the empty one.
 * @param {Element} field
 */
function controlIn(field) {
  return field.querySelector('.missing [data-control]') ?? field.querySelector('[data-control]');
}

/**
 * Give the focus to the field of a place of the study, or to the block that it is in.
 * @param {HTMLElement} form
 * @param {(string | number)[]} path
 * @returns {boolean} whether the form can show it
 */
export function leadTo(form, path) {
  const place = form.inert ? null : nearestBlock(form, path);
  const field = place?.matches('.field') ? controlIn(place) : place?.querySelector('summary, button, [data-control]');
  if (!(field instanceof HTMLElement)) return false;
  focusInside(field);
  return true;
}

/**
 * Return the button that solves a problem, if there is one.
 * @param {Problem} problem
 * @param {Change} change
 * @returns {HTMLElement[]}
 */
export function quickFixButton({ fix }, change) {
  if (!fix) return [];
  const button = make('button', { className: 'btn tiny fix', type: 'button', text: fix.label });
  button.addEventListener('click', () => change(fix.operation));
  return [button];
}

/**
 * Say at the fields what is wrong; a section says how much is wrong in it.
 * @param {HTMLElement} form
 * @param {Problem[]} problems
 * @param {Change} change
 */
export function showProblems(form, problems, change) {
  for (const words of findAll('.wrong', HTMLElement, form)) words.hidden = true;
  for (const badge of findAll('summary .badge', HTMLElement, form)) badge.hidden = true;
  for (const control of findAll('[aria-invalid]', HTMLElement, form)) control.removeAttribute('aria-invalid');
  for (const problem of [...problems].reverse()) {
    const place = nearestBlock(form, problem.path);
    const words = place?.querySelector(':scope > .wrong, :scope > .inside > .wrong');
    if (!(place instanceof HTMLElement) || !(words instanceof HTMLElement)) continue;
    words.replaceChildren(...withCode(problem.text), ' ', ...quickFixButton(problem, change));
    words.className = `wrong${problem.warning ? ' warn' : ''}`;
    words.hidden = false;
    if (problem.warning) continue;
    if (place.matches('.field')) controlIn(place)?.setAttribute('aria-invalid', 'true');
    for (let up = place.closest('details'); up; up = up.parentElement?.closest('details') ?? null) count(up);
  }
}

/** @param {HTMLDetailsElement} details */
function count(details) {
  const badge = details.querySelector(':scope > summary > .badge');
  if (!(badge instanceof HTMLElement)) return;
  badge.textContent = String(badge.hidden ? 1 : Number(badge.textContent) + 1);
  badge.hidden = false;
}
