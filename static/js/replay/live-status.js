// What a running game does now, as shown with its replay.

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
 * @param {HTMLElement} badge
 * @param {string | null} by
 */
export function showPauser(badge, by) {
  badge.hidden = by === null;
  badge.textContent = `Paused by ${by}`;
}
