// What is wrong with a draft, at the fields of the study builder's form.

import { findAll } from '../browser/dom.js';
import { keyOf } from './builder-fields.js';

/** @typedef {import('./builder-requests.js').Problem} Problem */

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
 * Say at the fields what is wrong; a section says how much is wrong in it.
 * @param {HTMLElement} form
 * @param {Problem[]} problems
 */
export function showProblems(form, problems) {
  for (const words of findAll('.wrong', HTMLElement, form)) words.hidden = true;
  for (const badge of findAll('summary .badge', HTMLElement, form)) badge.hidden = true;
  for (const control of findAll('[aria-invalid]', HTMLElement, form)) control.removeAttribute('aria-invalid');
  for (const problem of [...problems].reverse()) {
    const found = problem.path.map((_, index) => blockAt(form, problem.path.slice(0, problem.path.length - index)));
    const place = found.find(Boolean);
    const words = place?.querySelector(':scope > .wrong, :scope > .inside > .wrong');
    if (!(place instanceof HTMLElement) || !(words instanceof HTMLElement)) continue;
    words.textContent = problem.text;
    words.className = `wrong${problem.warning ? ' warn' : ''}`;
    words.hidden = false;
    if (problem.warning) continue;
    if (place.matches('.field')) place.querySelector('[data-control]')?.setAttribute('aria-invalid', 'true');
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
