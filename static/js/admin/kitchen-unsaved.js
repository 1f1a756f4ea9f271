// A drawing that was not saved: kept in this browser until it is.

/** @import { Grid } from '../board/kitchen.js' */

import { local, readJson } from '../browser/storage.js';

/** @typedef {{ rows: Grid, name: unknown, version: any }} Drawing */

export class UnsavedDrawing {
  /** @param {string} kitchen that the page was opened for; '' for a new one */
  constructor(kitchen) {
    this.key = `kitchen-draft/${kitchen}`;
  }

  /** @param {Drawing} drawing */
  keep(drawing) {
    local.setItem(this.key, JSON.stringify(drawing));
  }

  forget() {
    local.removeItem(this.key);
  }

  /**
   * Return what was kept; null if there is none, if it equals `rows`, or if the address asks for a drawing.
   * @param {Grid} rows
   * @returns {Drawing | null}
   */
  read(rows) {
    const given = new URLSearchParams(window.location.search);
    if (['copy', 'grid', 'version'].some((name) => given.has(name))) return null;
    const kept = readJson(local, this.key, null);
    const isGrid =
      Array.isArray(kept?.rows) && kept.rows.every((/** @type {unknown} */ row) => typeof row === 'string');
    return isGrid && kept.rows.join('\n') !== rows.join('\n') ? kept : null;
  }
}
