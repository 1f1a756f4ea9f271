// The page's state of a game, as plain data: defaults() and apply(message). The time is always an argument.

/** @import { Intention } from './intention.js' */
/** @import { Mark } from './marks.js' */

import { NO_INTENTION, intentionOf, isSameIntention } from './intention.js';
import { cellAfter, marks } from './marks.js';

export const GLIDE_SHARE = 0.9; // of a tick
export const GLIDE_MAX_MS = 180;

/** @typedef {'connecting' | 'open' | 'lost' | 'superseded' | 'closed'} Link */
/** @typedef {'waiting' | 'room' | 'ready' | 'countdown' | 'playing' | 'paused' | 'ended'} Phase room: another person is
 *   expected */
/** @typedef {Wire.Paused['reason'] | 'room'} PauseReason */

/**
 * @typedef {object} State
 * @property {Link} link
 * @property {number} linkSinceMs
 * @property {Phase} phase
 * @property {Wire.Welcome | null} game
 * @property {boolean} alone the participant waited for another person, and an agent takes the place
 * @property {boolean} starting the participant wants to start, and the server has not answered yet
 * @property {Wire.KitchenState | null} previous the kitchen before the current one
 * @property {Wire.KitchenState | null} current
 * @property {number} arrivedMs when the current kitchen came
 * @property {[x: number, y: number][]} from where each chef was on screen at that moment, in cells
 * @property {number[]} actions what led to the current kitchen
 * @property {Mark[]} marks
 * @property {Mark[]} marksBefore
 * @property {Intention | null} intention what the watched chef is predicted to do next at a station
 * @property {boolean} saysIntention whether the frame carries one, also that nothing is done soon
 * @property {number} intentionMs since when it is this one
 * @property {{ seconds: number, sinceMs: number } | null} countdown
 * @property {boolean} partnerSeen whether the other chef is in view
 * @property {boolean} partnerSeenBefore the same in the kitchen before
 * @property {boolean} asked whether the participant asks for the marks
 * @property {[x: number, y: number][]} unknown pots and counters that the participant has never seen
 * @property {{ reason: PauseReason, leftS: number, sinceMs: number, fresh: boolean } | null} pause fresh: nothing has
 *   been played on this page yet
 * @property {Wire.Lesson | null} lesson
 * @property {string[]} lessons keys in the order in which they were taught
 * @property {Wire.Ended | null} ended
 * @property {string | null} notice
 * @property {{ direction: number, seq: number } | null} turn how the own chef turns before the server has answered
 * @property {number} applied
 * @property {number} awayLimitS how long an absence that begins now may last; 0: unknown
 */

/** @typedef {State & { game: Wire.Welcome, current: Wire.KitchenState }} StartedState */

/**
 * Return the state before the first message of the server.
 * @returns {State}
 */
export function defaults() {
  return {
    ...{ link: 'connecting', linkSinceMs: 0, phase: 'waiting', game: null, alone: false, starting: false },
    ...{ previous: null, current: null, arrivedMs: 0, from: [], actions: [4, 4], marks: [], marksBefore: [] },
    ...{ intention: null, saysIntention: false, intentionMs: 0 },
    ...{ partnerSeen: true, partnerSeenBefore: true, unknown: [], asked: true },
    ...{ countdown: null, pause: null, lesson: null, lessons: [], ended: null, notice: null, turn: null, applied: -1 },
    awayLimitS: 0,
  };
}

/**
 * Return the state after a message of the server. The old state stays as it is.
 * @param {State} state
 * @param {Wire.FromServer} message
 * @param {number} now in ms
 * @returns {State}
 */
export function apply(state, message, now) {
  switch (message.type) {
    case 'welcome':
      return applyWelcome(state, message, now);
    case 'waiting': {
      const pause = { reason: /** @type {const} */ ('room'), leftS: message.left_s, sinceMs: now, fresh: false };
      return { ...state, link: 'open', phase: 'room', pause };
    }
    case 'countdown': {
      const countdown = { seconds: message.seconds, sinceMs: now };
      return { ...state, phase: 'countdown', pause: null, countdown, awayLimitS: message.away_s || state.awayLimitS };
    }
    case 'tick':
      return applyTick(state, message, now);
    case 'paused': {
      const fresh = state.phase === 'ready' || Boolean(state.pause?.fresh);
      const pause = { reason: message.reason, leftS: message.left_s, sinceMs: now, fresh };
      return { ...state, phase: 'paused', turn: null, countdown: null, pause };
    }
    case 'lesson':
      return { ...state, lesson: message, lessons: withLesson(state.lessons, message) };
    case 'ended':
      return { ...state, phase: 'ended', ended: message, pause: null, countdown: null, turn: null };
    case 'notice':
      return { ...state, notice: message.text };
    case 'superseded':
      return { ...state, link: 'superseded', linkSinceMs: now, turn: null };
    default:
      return state;
  }
}

/**
 * Return the state after the connection changed.
 * @param {State} state
 * @param {Link} link
 * @param {number} now
 * @returns {State}
 */
export function applyLink(state, link, now) {
  return state.link === link ? state : { ...state, link, linkSinceMs: now, turn: null };
}

/**
 * Return the state in which the own chef faces `direction`, until the tick that took the input `seq` into account.
 * @param {State} state
 * @param {number} direction
 * @param {number} seq
 * @returns {State}
 */
export function applyTurn(state, direction, seq) {
  return state.phase === 'playing' ? { ...state, turn: { direction, seq } } : state;
}

/**
 * @param {State} state
 * @param {Wire.Welcome} message
 * @param {number} now
 * @returns {State}
 */
function applyWelcome(state, message, now) {
  return {
    ...defaults(),
    link: 'open',
    linkSinceMs: now,
    phase: 'ready',
    game: message,
    current: message.state,
    arrivedMs: now,
    partnerSeen: message.partner_seen,
    partnerSeenBefore: message.partner_seen,
    unknown: message.unknown,
    asked: message.asked,
    from: message.state.players.map(([x, y]) => [x, y]),
    alone: state.alone || (state.phase === 'room' && message.partner === 'agent'),
    lesson: state.lesson,
    lessons: state.lessons,
    notice: state.notice,
    awayLimitS: message.away_s || state.awayLimitS,
  };
}

/**
 * @param {State} state
 * @param {Wire.Tick} message
 * @param {number} now
 * @returns {State}
 */
function applyTick(state, message, now) {
  if (!isStarted(state)) return state;
  const { grid, watched_seat: watched } = state.game;
  const players = message.state.players;
  const phase = phaseAfter(state, message, now);
  const drawn = marks(message.prediction, players[watched], players[1 - watched], grid);
  const ahead = drawn.flatMap((mark) => (mark.kind === 'move' ? [cellAfter(mark)] : []));
  const intention = intentionOf(message.intention, players[watched], players[1 - watched], grid, ahead);
  return {
    ...state,
    phase,
    pause: phase === 'paused' ? state.pause : null,
    countdown: phase === 'countdown' ? state.countdown : null,
    previous: state.current,
    current: message.state,
    arrivedMs: now,
    partnerSeen: message.partner_seen,
    partnerSeenBefore: state.partnerSeen,
    unknown: message.unknown,
    asked: message.asked,
    from: players.map((player, seat) => startOf(state, seat, player, now)),
    actions: message.actions,
    marks: drawn,
    marksBefore: state.marks,
    intention,
    saysIntention: message.intention[0] !== NO_INTENTION,
    intentionMs: isSameIntention(intention, state.intention) ? state.intentionMs : now,
    turn: state.turn && message.applied >= state.turn.seq ? null : state.turn,
    applied: message.applied,
  };
}

/**
 * Only the end of a countdown starts a game. The state that is shown during it comes as a tick too, and so does a
 * timestep that was being made when the game was paused: soon, while the first one comes when the countdown is over.
 * @param {StartedState} state
 * @param {Wire.Tick} message
 * @param {number} now
 * @returns {Phase}
 */
function phaseAfter({ phase, countdown, current }, message, now) {
  if (phase === 'ended' || phase === 'paused') return phase;
  const isEarly = countdown !== null && now - countdown.sinceMs < countdown.seconds * 500;
  return phase === 'countdown' && (isEarly || message.state.t <= current.t) ? 'countdown' : 'playing';
}

/**
 * A chef glides from where it is on screen now; after a gap of more than a cell it jumps.
 * @param {StartedState} state
 * @param {number} seat
 * @param {[x: number, y: number, ...rest: number[]]} player
 * @param {number} now
 * @returns {[x: number, y: number]}
 */
function startOf(state, seat, player, now) {
  const [x, y] = place(state, seat, now);
  if (seat !== state.game.seat && !state.partnerSeen) return [player[0], player[1]]; // it comes into view
  return Math.abs(x - player[0]) + Math.abs(y - player[1]) > 1.5 ? [player[0], player[1]] : [x, y];
}

/**
 * Whether a chef is drawn: the other one only while it is in view.
 * @param {StartedState} state
 * @param {number} seat
 */
export function isInView(state, seat) {
  return state.partnerSeen || seat === state.game.seat;
}

/**
 * Whether there is a game to draw.
 * @param {State} state
 * @returns {state is StartedState}
 */
export function isStarted(state) {
  return state.game !== null && state.current !== null;
}

/**
 * Return the share of the way to the current kitchen at `now`, 0..1, quick at first.
 * @param {State} state
 * @param {number} now
 */
export function progress(state, now) {
  const tickMs = state.game?.tick_ms ?? 200;
  const time = Math.min(1, Math.max(0, (now - state.arrivedMs) / Math.min(GLIDE_MAX_MS, GLIDE_SHARE * tickMs)));
  return time * (1.6 - 0.6 * time);
}

/**
 * Return where a chef is on screen at `now`: column and row, fractions of a cell on its way.
 * @param {StartedState} state
 * @param {number} seat
 * @param {number} now
 * @returns {[x: number, y: number]}
 */
export function place(state, seat, now) {
  const [x, y] = state.current.players[seat];
  const [fromX, fromY] = state.from[seat] ?? [x, y];
  const part = progress(state, now);
  return [fromX + (x - fromX) * part, fromY + (y - fromY) * part];
}

/**
 * Return the direction that a chef faces on screen: for the own chef the key that was just pressed, else the server's.
 * @param {StartedState} state
 * @param {number} seat
 */
export function facing(state, seat) {
  if (state.turn && seat === state.game.seat) return state.turn.direction;
  return state.current.players[seat][2];
}

/**
 * Return the seconds left of the episode; null without a time limit.
 * @param {State} state
 */
export function secondsLeft(state) {
  if (!isStarted(state) || state.game.endless) return null;
  return Math.max(0, (state.game.horizon - state.current.t) * state.game.tick_ms) / 1000;
}

/**
 * @param {string[]} lessons
 * @param {Wire.Lesson} lesson
 */
function withLesson(lessons, { key, index }) {
  const list = lessons.slice();
  list[index] = key;
  return list;
}
