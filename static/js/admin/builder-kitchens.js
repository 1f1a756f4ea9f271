// Kitchens of a draft: the kitchen editor in a dialog of the study builder. What is saved there is named in the draft.

import { root } from '../browser/addresses.js';
import { find } from '../browser/dom.js';
import { make } from './elements.js';

/** @typedef {(string | number)[]} Path */
/** @typedef {{ name?: any, grid?: any } | undefined} Choice a kitchen as the draft has it; undefined: a new one */

/** @param {Path} path */
export function isKitchen(path) {
  return path.length === 2 && (path[0] === 'layouts' || (path[0] === 'tutorial' && path[1] === 'layout'));
}

/**
 * The first title of a kitchen: its name, in every language.
 * @param {string} name
 * @param {string[]} languages
 */
export function titleFor(name, languages) {
  return Object.fromEntries(languages.map((language) => [language, name]));
}

/**
 * @param {string} words
 * @param {string} control
 * @param {() => void} open
 */
export function drawButton(words, control, open) {
  const button = make('button', { className: 'btn tiny', type: 'button', 'data-control': control }, words);
  button.addEventListener('click', open);
  return button;
}

export class KitchenDialog {
  /**
   * @param {string[]} own the kitchens that were saved on this server
   * @param {string[]} known these, and the bundled ones
   */
  constructor(own, known) {
    this.own = own;
    this.known = known;
    this.dialog = find('#kitchen-dialog', HTMLDialogElement);
    /** @type {HTMLIFrameElement | null} */
    this.frame = null;
    /** @type {(name: string) => void} */
    this.saved = () => undefined;
    find('#kitchen-close', HTMLButtonElement).addEventListener('click', () => this.dialog.close());
    this.dialog.addEventListener('close', () => this.frame?.remove());
    addEventListener('message', (event) => this.hear(event));
  }

  /**
   * @param {Choice} kitchen
   * @param {(name: string) => void} saved called with the name of the kitchen that was saved
   */
  open(kitchen, saved) {
    this.saved = saved;
    this.frame?.remove();
    this.frame = make('iframe', { src: this.address(kitchen), title: 'Kitchen editor' });
    this.dialog.prepend(this.frame);
    this.dialog.showModal();
    this.frame.focus();
  }

  /** @param {Choice} kitchen */
  address(kitchen) {
    const name = typeof kitchen?.name === 'string' ? kitchen.name : '';
    const grid = typeof kitchen?.grid === 'string' ? kitchen.grid : '';
    if (!grid && this.own.includes(name)) return `${root}/admin/kitchen/${encodeURIComponent(name)}?in=draft`;
    const isBundled = this.known.includes(name) && !this.own.includes(name);
    /** @type {Record<string, string>} */
    const fields = grid ? { grid, name } : isBundled ? { copy: name } : { name };
    return `${root}/admin/kitchens/new?${new URLSearchParams({ in: 'draft', ...fields })}`;
  }

  /** @param {MessageEvent} event */
  hear(event) {
    const isOurs = event.origin === window.location.origin && event.source === this.frame?.contentWindow;
    const name = event.data?.kitchen;
    if (!isOurs || typeof name !== 'string') return;
    this.dialog.close();
    if (!name) return;
    for (const names of [this.own, this.known]) if (!names.includes(name)) names.push(name);
    this.saved(name);
  }
}
