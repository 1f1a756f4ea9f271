// Everything the page knows of the game, as plain data: defaults() and apply(). Knows no DOM, no socket, no clock of its own.

import { marks } from './marks.js';

export const GLIDE_SHARE = 0.9; // of a tick
export const GLIDE_MAX_MS = 180;

/** The state before anything has come from the server. */
export function defaults() {
  return {
    link: 'connecting', // connecting | open | lost | superseded | closed
    linkSinceMs: 0,
    phase: 'waiting', // waiting | room (for the other person) | ready | countdown | playing | paused | ended
    game: null, // the Welcome
    alone: false, // waited for another person, and an agent stands in
    previous: null, // Kitchen before the current one
    current: null, // Kitchen
    arrivedMs: 0, // when the current kitchen came
    from: [], // where each chef was on screen at that moment, in cells
    actions: [4, 4], // what led to the current kitchen
    marks: [], // see marks.js
    marksBefore: [],
    countdown: null, // {seconds, sinceMs}
    pause: null, // {reason, leftS, sinceMs, fresh: nothing has been played on this page yet}
    lesson: null,
    lessons: [], // keys in the order in which they were taught
    ended: null,
    notice: null,
    turn: null, // {direction, seq}: own chef turns before the server has answered
    applied: -1,
  };
}

const HANDLERS = {
  welcome: (state, message, now) => ({
    ...defaults(),
    link: 'open',
    linkSinceMs: now,
    phase: 'ready',
    game: message,
    current: message.state,
    arrivedMs: now,
    from: message.state.players.map(([x, y]) => [x, y]),
    alone: state.alone || (state.phase === 'room' && message.partner === 'agent'),
    lesson: state.lesson,
    lessons: state.lessons,
    notice: state.notice,
  }),
  waiting: (state, message, now) => ({
    ...state, link: 'open', phase: 'room', pause: { reason: 'room', leftS: message.left_s, sinceMs: now, fresh: false },
  }),
  countdown: (state, message, now) => ({
    ...state, phase: 'countdown', pause: null, countdown: { seconds: message.seconds, sinceMs: now },
  }),
  tick: applyTick,
  paused: (state, message, now) => ({
    ...state, phase: 'paused', turn: null, countdown: null, 
    pause: { reason: message.reason, leftS: message.left_s, sinceMs: now, fresh: state.phase === 'ready' || Boolean(state.pause?.fresh) },
  }),
  lesson: (state, message) => ({
    ...state, lesson: message, lessons: withLesson(state.lessons, message),
  }),
  ended: (state, message) => ({ ...state, phase: 'ended', ended: message, pause: null, countdown: null, turn: null }),
  notice: (state, message) => ({ ...state, notice: message.text }),
  superseded: (state, message, now) => ({ ...state, link: 'superseded', linkSinceMs: now, turn: null }),
};

/** The state after a message of the server (see messages.js), `now` in ms. The old state is left as it is. */
export function apply(state, message, now) {
  const handler = HANDLERS[message.type];
  return handler ? handler(state, message, now) : state;
}

/** The state after the connection changed: 'open', 'lost', 'closed' (for good). */
export function applyLink(state, link, now) {
  if (state.link === link) return state;
  return { ...state, link, linkSinceMs: now, turn: null };
}

/** The own chef faces `direction` from now on, until the tick that took Input `seq` into account. */
export function applyTurn(state, direction, seq) {
  return state.phase === 'playing' ? { ...state, turn: { direction, seq } } : state;
}

function applyTick(state, message, now) {
  if (!state.game) return state;
  const { grid, watched_seat: watched } = state.game;
  const players = message.state.players;
  const counting = phaseOf(state, message) === 'countdown';
  return {
    ...state,
    phase: phaseOf(state, message),
    pause: null,
    countdown: counting ? state.countdown : null,
    previous: state.current,
    current: message.state,
    arrivedMs: now,
    from: players.map((player, seat) => startOf(state, seat, player, now)),
    actions: message.actions,
    marks: marks(message.prediction, players[watched], players[1 - watched], grid),
    marksBefore: state.marks,
    turn: state.turn && message.applied >= state.turn.seq ? null : state.turn,
    applied: message.applied,
  };
}

/** The state that stands while the countdown runs comes as a tick too: it starts nothing. */
function phaseOf(state, message) {
  if (state.phase === 'ended') return 'ended';
  return state.phase === 'countdown' && message.state.t <= state.current.t ? 'countdown' : 'playing';
}

/** A chef glides from where it is seen now; after a gap of more than a cell it is simply put. */
function startOf(state, seat, player, now) {
  const [x, y] = place(state, seat, now);
  return Math.abs(x - player[0]) + Math.abs(y - player[1]) > 1.5 ? [player[0], player[1]] : [x, y];
}

/** Share of the way to the current kitchen at `now`, 0..1, quick at first. */
export function progress(state, now) {
  const tickMs = state.game?.tick_ms ?? 200;
  const time = Math.min(1, Math.max(0, (now - state.arrivedMs) / Math.min(GLIDE_MAX_MS, GLIDE_SHARE * tickMs)));
  return time * (1.6 - 0.6 * time);
}

/** Where a chef is seen at `now`: [column, row], fractions of a cell on its way. */
export function place(state, seat, now) {
  const [x, y] = state.current.players[seat];
  const [fromX, fromY] = state.from[seat] ?? [x, y];
  const part = progress(state, now);
  return [fromX + (x - fromX) * part, fromY + (y - fromY) * part];
}

/** The direction a chef is seen to face: its own key at once, else what the server says. */
export function facing(state, seat) {
  if (state.turn && seat === state.game.seat) return state.turn.direction;
  return state.current.players[seat][2];
}

/** Seconds left of the episode; null without a time limit. */
export function secondsLeft(state) {
  const { game, current } = state;
  if (!game || game.endless) return null;
  return Math.max(0, (game.horizon - current.t) * game.tick_ms) / 1000;
}

function withLesson(lessons, { key, index }) {
  const list = lessons.slice();
  list[index] = key;
  return list;
}
