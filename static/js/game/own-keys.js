// The keys that a participant has chosen: on the keycaps of the page, in the dialog that changes them, in the game.

/** @import { Catalogue } from '../browser/texts.js' */
/** @import { Keys } from './input.js' */

import { find } from '../browser/dom.js';
import { keyCaps, showKeyCaps } from './key-caps.js';
import { KeyboardLayout } from './key-names.js';
import { KeysDialog, storedBindings } from './keys-dialog.js';

export class OwnKeys {
  /**
   * @param {HTMLElement} page
   * @param {Keys} keys of the game
   * @param {Catalogue} text
   * @param {() => void} changed called when other texts that name keys have to be written again
   */
  constructor(page, keys, text, changed) {
    this.page = page;
    this.keys = keys;
    this.text = text;
    this.changed = changed;
    this.bindings = storedBindings();
    this.layout = new KeyboardLayout();
  }

  /** Return the keycaps of each action. */
  caps() {
    return keyCaps(this.bindings, this.text, this.layout);
  }

  /** Write the keys wherever the page names them. */
  show() {
    this.changed();
    showKeyCaps(this.page, this.bindings, this.text, this.layout);
  }

  /** Let the participant choose other keys, and learn what the keyboard's keys are called. */
  offer() {
    const dialog = new KeysDialog(find('#keys-dialog', HTMLDialogElement), this.text, this.layout, (next) => {
      this.bindings = next;
      this.keys.bind(next);
      this.show();
    });
    find('#change-keys', HTMLElement, this.page).addEventListener('click', () => dialog.open());
    document.addEventListener('keydown', (event) => this.layout.learn(event));
    this.layout.changed = () => {
      this.show();
      dialog.refresh();
    };
    this.layout.ask();
  }
}
