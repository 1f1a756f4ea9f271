// Buttons of a researcher's page that ask for confirmation in a dialog.

import { findAll } from '../browser/dom.js';

for (const button of findAll('[data-ask]', HTMLElement)) {
  button.addEventListener('click', () => dialogOf(`#ask-${button.dataset.ask}`)?.showModal());
}
for (const button of findAll('[data-close]', HTMLElement)) {
  button.addEventListener('click', () => button.closest('dialog')?.close());
}
for (const form of findAll('dialog form[method]', HTMLFormElement)) {
  form.addEventListener('submit', () => setTimeout(() => form.closest('dialog')?.close(), 0));
}

/**
 * @param {string} selector
 * @returns {HTMLDialogElement | null}
 */
function dialogOf(selector) {
  return document.querySelector(selector);
}
