// What the kitchen editor sends to the server, reads from and offers as files, and tells the researcher.

import { root } from '../browser/addresses.js';
import { find } from '../browser/dom.js';
import { make } from './elements.js';

/**
 * Send a form; return the answer's status and JSON. Status 0: no answer came.
 * @param {string} token of the page's forms
 * @param {string} path below /admin/
 * @param {Record<string, string>} fields
 * @returns {Promise<{ status: number, data: any }>}
 */
export async function post(token, path, fields) {
  const body = new URLSearchParams({ form_token: token, ...fields });
  try {
    const headers = { accept: 'application/json' };
    const answer = await fetch(`${root}/admin/${path}`, { method: 'POST', body, headers });
    return { status: answer.status, data: await answer.json() };
  } catch {
    return { status: 0, data: { detail: 'The server does not answer. Your drawing is kept in this browser' } };
  }
}

/**
 * Return why a request failed, as a sentence.
 * @param {number} status
 * @param {any} data
 */
export function reasonOf(status, data) {
  if (status === 401 || status === 403) return 'You are signed out. Sign in in another tab, then reload this page.';
  const detail = typeof data.detail === 'string' ? data.detail : 'That did not work';
  return detail.endsWith('.') ? detail : `${detail}.`;
}

/**
 * Show what the researcher should know, also to somebody who has scrolled down to the files; '' hides it.
 * @param {string} text
 * @param {boolean} bad
 * @param {Node[]} more
 */
export function note(text, bad = false, ...more) {
  const place = find('#note', HTMLElement);
  place.hidden = !text;
  place.className = bad ? 'note bad' : 'note';
  place.replaceChildren(text, ...more);
  if (text) place.scrollIntoView({ block: 'nearest' });
}

/**
 * Let the browser save a file.
 * @param {Blob | null} blob
 * @param {string} name
 */
export function offer(blob, name) {
  if (!blob) return note('The file could not be made.', true);
  const link = make('a', { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/**
 * Read what the researcher chooses in a file field.
 * @param {HTMLInputElement} field
 * @param {(text: string, name: string) => Promise<void>} take
 */
export function onFile(field, take) {
  field.addEventListener('change', async () => {
    const [file] = field.files ?? [];
    if (file) await take(await file.text(), file.name);
    field.value = ''; // the same file can be chosen again
  });
}

/**
 * Return what a researcher can do where somebody else has saved the kitchen: look at theirs, or replace it.
 * @param {string} name
 * @param {number} newest version
 * @param {() => void} replaceIt
 */
export function newerVersion(name, newest, replaceIt) {
  const other = make('a', { text: `Look at version ${newest}`, href: `${root}/admin/kitchen/${name}` });
  other.target = '_blank';
  const replace = make('button', { className: 'btn tiny', type: 'button', text: 'Save mine as the newest' });
  replace.addEventListener('click', replaceIt);
  return [other, replace];
}
