// The button that copies the completion code.

import { find } from '../browser/dom.js';

const button = document.getElementById('copy');
if (button) showCopyButton(button);

/** @param {HTMLElement} button */
function showCopyButton(button) {
  const code = find('#code', HTMLElement);
  const note = find('#code-note', HTMLElement);
  button.hidden = false;
  button.addEventListener('click', async () => {
    try {
      await navigator.clipboard.writeText((code.textContent ?? '').trim());
      note.textContent = button.dataset.copied ?? '';
    } catch {
      getSelection()?.selectAllChildren(code);
      note.textContent = button.dataset.selected ?? '';
    }
  });
}
