// Chooses which dialog is shown now, as a function of the state; dialogs.js puts it on the page.

/** @import { State } from '../board/state.js' */

import { isStarted } from '../board/state.js';

/** @typedef {'none' | 'start' | 'count' | 'pause' | 'banner' | 'over' | 'other' | 'closed'} DialogName */
/**
 * @typedef {object} Dialog
 * @property {DialogName} name
 * @property {string} reason
 * @property {number | null} seconds whole seconds left; null: none to show
 * @property {boolean} action whether the participant can continue with a button
 */

const LOST_AFTER_MS = 700; // the first connection of a page may take this long before the page mentions it
const SILENT_TICKS = 6;
/** Pauses in which nobody's absence counts. */
const UNCOUNTED_REASONS = new Set(['database', 'researcher']);
/** Pauses that the participant ends. */
const OWN_REASONS = new Set(['hidden', 'blur', 'lost', 'other_tab', 'server']);

/**
 * @param {State} state
 * @param {number} now
 * @returns {Dialog}
 */
export function chooseDialog(state, now) {
  if (state.link === 'superseded') return dialog('other');
  if (state.phase === 'ended') return dialog('over');
  if (state.link === 'closed') return dialog('closed');
  if (state.link === 'lost') return lostDialog(state, now);
  if (state.link === 'connecting') {
    return now - state.linkSinceMs > LOST_AFTER_MS ? dialog('banner', 'connecting') : dialog('none');
  }
  return gameDialog(state, now);
}

/**
 * @param {State} state
 * @param {number} now
 * @returns {Dialog}
 */
function lostDialog(state, now) {
  if (state.phase === 'room') return dialog('banner', 'lost_room');
  const seconds = secondsUntilEnd(state, now);
  return seconds === 0 ? dialog('banner', 'lost_long') : dialog('banner', 'lost', seconds);
}

/**
 * @param {State} state
 * @param {number} now
 * @returns {Dialog}
 */
function gameDialog(state, now) {
  if (state.phase === 'paused' || state.phase === 'room') return pauseDialog(state, now);
  if (!isStarted(state)) return dialog('none');
  if (state.phase === 'ready') {
    if (state.starting) return dialog('none');
    return dialog('start', startReason(state, state.game), null, true);
  }
  if (state.phase === 'countdown') return countdownDialog(state, now);
  const silenceMs = Math.max(1200, SILENT_TICKS * state.game.tick_ms);
  const silent = state.phase === 'playing' && now - state.arrivedMs > silenceMs;
  return silent ? dialog('banner', 'silent') : dialog('none');
}

/**
 * @param {State} state
 * @param {number} now
 * @returns {Dialog}
 */
function countdownDialog({ countdown, current }, now) {
  const left = countdown ? countdown.seconds - (now - countdown.sinceMs) / 1000 : 0;
  return left > 0 ? dialog('count', current && current.t > 0 ? 'on' : 'begin', Math.ceil(left)) : dialog('none');
}

/**
 * @param {State} state
 * @param {number} now
 * @returns {Dialog}
 */
function pauseDialog(state, now) {
  const { pause, game } = state;
  if (!pause) return dialog('none');
  const { reason, leftS, sinceMs, fresh } = pause;
  const left = leftS > 0 ? Math.max(0, Math.ceil(leftS - (now - sinceMs) / 1000)) : null;
  if (reason === 'database') return dialog('banner', 'database', left);
  // Sent before the server heard that the participant is ready.
  if (fresh && state.starting && reason === 'lost') return dialog('none');
  if (fresh && reason !== 'other_tab' && OWN_REASONS.has(reason)) {
    return dialog('start', game ? startReason(state, game) : 'resumed', left, true);
  }
  return dialog('pause', reason, left, OWN_REASONS.has(reason));
}

/** @type {(state: State, game: Wire.Welcome) => string} */
const startReason = ({ alone }, { resumed, kind }) => (resumed ? 'resumed' : alone ? 'alone' : kind);

/**
 * Return how long the own absence, which began when the connection was lost, may last. A pause that was counting down
 * then ends the game at its own time, if that is earlier.
 * @param {State} state
 * @param {number} now
 */
function secondsUntilEnd(state, now) {
  const { awayLimitS, linkSinceMs, phase, pause } = state;
  if (!awayLimitS || !absenceCounts(state)) return null;
  const ends = [linkSinceMs + awayLimitS * 1000];
  if (phase === 'paused' && pause && pause.leftS > 0) ends.push(pause.sinceMs + pause.leftS * 1000);
  return Math.max(0, Math.ceil((Math.min(...ends) - now) / 1000));
}

/**
 * Whether the game ends if the participant is away for too long: not before it starts, nor in a pause of the server.
 * @param {State} state
 */
function absenceCounts({ phase, pause, game }) {
  if (phase === 'paused') return !(pause && UNCOUNTED_REASONS.has(pause.reason));
  return phase === 'countdown' || phase === 'playing' || (phase === 'ready' && game !== null && game.resumed);
}

/**
 * @param {DialogName} name
 * @param {string} reason
 * @param {number | null} seconds
 * @param {boolean} action
 * @returns {Dialog}
 */
function dialog(name, reason = '', seconds = null, action = false) {
  return { name, reason, seconds, action };
}
