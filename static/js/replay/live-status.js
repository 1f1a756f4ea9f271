// What a running game does now, as shown with its replay.

import { find, findAll } from '../browser/dom.js';

/**
 * Show whether the game is played or paused, for how long, and the round trip time.
 * @param {HTMLElement} now
 * @param {HTMLElement} rtt
 * @param {Researcher.Card} card
 */
export function showStatus(now, rtt, { flag, since_s: since, rtt_ms: ms, level }) {
  now.textContent = level && since !== null ? `${flag}, ${since} s` : flag;
  now.className = ['', 'flag warn', 'flag bad'][level];
  rtt.textContent = ms === null ? '–' : `${ms} ms`;
}

/**
 * Show which researcher pauses the game; null: none.
 * @param {string | null} by
 */
export function showPauser(by) {
  const badge = find('#paused-badge', HTMLElement);
  badge.hidden = by === null;
  badge.textContent = `Paused by ${by}`;
}

/** Show that the game is played now, and what can be done about it. */
export function showLive() {
  showBadge('Live', 'badge good');
  for (const button of findAll('[data-while-live], #to-live', HTMLElement)) button.hidden = false;
}

/** Show that the game is over. */
export function showOver() {
  showBadge('Over', 'badge plain');
  showPauser(null);
  find('#to-live', HTMLElement).hidden = true;
  find('#now', HTMLElement).textContent = 'over';
}

/**
 * @param {string} words
 * @param {string} className
 */
function showBadge(words, className) {
  const badge = find('#live-badge', HTMLElement);
  badge.textContent = words;
  badge.className = className;
}
