// Which message lies over the kitchen now. A pure function of the state: dialogs.js puts it on the page.

const LOST_AFTER_MS = 700; // the first connection of a page may take so long without a word
const SILENT_TICKS = 6;
const OWN_REASONS = new Set(['hidden', 'blur', 'lost', 'other_tab', 'server']); // the participant says when it goes on

/** {name: 'none' | 'start' | 'count' | 'pause' | 'banner' | 'over' | 'other' | 'closed', reason, seconds, action}; `seconds` are
 * whole seconds left (null: none to show), `action` whether the participant can go on by a button. */
export function viewOf(state, now) {
  if (state.link === 'superseded') return view('other');
  if (state.phase === 'ended') return view('over');
  if (state.link === 'closed') return view('closed');
  if (state.link === 'lost') return view('banner', 'lost', lostSeconds(state, now));
  if (state.link === 'connecting') return now - state.linkSinceMs > LOST_AFTER_MS ? view('banner', 'connecting') : view('none');
  return gameView(state, now);
}

function gameView(state, now) {
  if (state.phase === 'ready') return view('start', state.game.resumed ? 'resumed' : state.alone ? 'alone' : state.game.kind, null, true);
  if (state.phase === 'countdown') return countView(state, now);
  if (state.phase === 'paused' || state.phase === 'room') return pauseView(state, now);
  const silent = state.phase === 'playing' && now - state.arrivedMs > Math.max(1200, SILENT_TICKS * state.game.tick_ms);
  return silent ? view('banner', 'silent') : view('none');
}

function countView({ countdown, current }, now) {
  const left = countdown.seconds - (now - countdown.sinceMs) / 1000;
  return left > 0 ? view('count', current.t > 0 ? 'on' : 'begin', Math.ceil(left)) : view('none');
}

function pauseView({ pause }, now) {
  const left = pause.leftS > 0 ? Math.max(0, Math.ceil(pause.leftS - (now - pause.sinceMs) / 1000)) : null;
  if (pause.reason === 'database') return view('banner', 'database', left);
  if (pause.fresh && pause.reason !== 'other_tab' && OWN_REASONS.has(pause.reason)) return view('start', 'resumed', left, true);
  return view('pause', pause.reason, left, OWN_REASONS.has(pause.reason));
}

function lostSeconds(state, now) {
  const limit = state.awayLimitS;
  return limit ? Math.max(0, Math.ceil(limit - (now - state.linkSinceMs) / 1000)) : null;
}

function view(name, reason = '', seconds = null, action = false) {
  return { name, reason, seconds, action };
}
