// Reloads the page when the participant's step has become another page.

import { session } from '../browser/storage.js';

const RELOAD_LOOP_MS = 10_000;

/**
 * Load the page again, unless that was just done: twice in a row would be an endless loop. Return the link to show.
 * @returns {'connecting' | 'closed'}
 */
export function reloadOnce() {
  const last = Number(session.getItem('kitchenmind.left') ?? 0);
  session.setItem('kitchenmind.left', Date.now());
  if (Date.now() - last < RELOAD_LOOP_MS) return 'closed';
  location.reload();
  return 'connecting';
}
