// Builds the messages that the page sends and checks those that it receives, as docs/reference/protocol.md describes
// them.

import { PROTOCOL } from '../browser/protocol.js';

/** @typedef {(value: unknown) => boolean} Check */

/** @type {Check} */
const number = (value) => typeof value === 'number' && Number.isFinite(value);
/** @type {Check} */
const text = (value) => typeof value === 'string';
/** @type {Check} */
const flag = (value) => typeof value === 'boolean';
/** @type {(check: Check) => Check} */
const listOf = (check) => (value) => Array.isArray(value) && value.every(check);
/** @type {(length: number) => Check} */
const numbers = (length) => (value) => Array.isArray(value) && value.length === length && value.every(number);
/** @type {(fields: Record<string, Check>) => Check} */
const shape = (fields) => (value) => typeof value === 'object' && value !== null && wrongField(value, fields) === null;

/** @type {Record<keyof Wire.KitchenState, Check>} */
const KITCHEN = {
  ...{ t: number, players: listOf(numbers(4)), counters: listOf(numbers(3)), pots: listOf(numbers(4)) },
  ...{ score: number, soups: number },
};

/** @typedef {{ [M in Wire.FromServer as M['type']]: Record<Exclude<keyof M, 'type'>, Check> }} Checks */

/** @type {Checks} */
const INCOMING = {
  welcome: {
    ...{ protocol: number, episode: text, kind: text, number, episodes: number, layout: text, title: text },
    ...{ grid: listOf(text), seat: number, watched_seat: number, horizon: number, tick_ms: number, steps: number },
    ...{ shows_predictions: flag, state: shape(KITCHEN), resumed: flag, endless: flag, partner: text },
    ...{ show: text, view_radius: number, partner_seen: flag, unknown: listOf(numbers(2)), asked: flag, display: text },
    away_s: number,
  },
  waiting: { left_s: number },
  countdown: { seconds: number, away_s: number },
  tick: {
    ...{ state: shape(KITCHEN), prediction: listOf(numbers(2)), actions: numbers(2), applied: number, late: flag },
    ...{ partner_seen: flag, unknown: listOf(numbers(2)), asked: flag, intention: numbers(4), pad: text },
  },
  paused: { reason: text, left_s: number },
  lesson: { key: text, index: number, steps: number, done: flag },
  ended: { score: number, soups: number, progress: number, passed: flag, next: text, reason: text },
  ping: { id: number },
  notice: { text },
  refused: { code: text, reason: text },
  superseded: {},
};

/**
 * Return the first field of `value` that is missing or of the wrong type; null if all are valid.
 * @param {object} value
 * @param {Record<string, Check>} fields
 */
function wrongField(value, fields) {
  const given = /** @type {Record<string, unknown>} */ (value);
  return Object.keys(fields).find((name) => !fields[name](given[name])) ?? null;
}

/**
 * Return the message in a frame of the server. Throws a TypeError that names what is wrong.
 * @param {string} frame
 * @returns {Wire.FromServer}
 */
export function parse(frame) {
  const message = JSON.parse(frame);
  /** @type {Record<string, Record<string, Check>>} */
  const known = INCOMING;
  const fields = Object.keys(known).includes(message?.type) ? known[message.type] : null;
  if (!fields) throw new TypeError(`unknown message ${String(message?.type)}`);
  const wrong = wrongField(message, fields);
  if (wrong !== null) throw new TypeError(`${message.type}: bad field ${wrong}`);
  return message;
}

/** @type {(tab: string, lastTimestep: number) => Wire.Hello} */
export const hello = (tab, lastTimestep) => ({ type: 'hello', protocol: PROTOCOL, tab, last_timestep: lastTimestep });

/** @type {() => Wire.Ready} */
export const ready = () => ({ type: 'ready' });

/** @type {(seq: number, held: number | null, tap: number | null, clientMs: number, marks?: boolean) => Wire.Input} */
export const input = (seq, held, tap, clientMs, marks) => {
  /** @type {Wire.Input} */
  const message = { type: 'input', seq, held, tap: /** @type {Wire.Input['tap']} */ (tap), client_ms: clientMs };
  return marks === undefined ? message : { ...message, marks };
};

/** @type {(reason: Wire.Away['reason']) => Wire.Away} */
export const away = (reason) => ({ type: 'away', reason });

/** @type {(id: number) => Wire.Pong} */
export const pong = (id) => ({ type: 'pong', id });

/** @type {(problem: unknown) => Wire.ClientError} */
export const clientError = (problem) => ({ type: 'trouble', text: String(problem).slice(0, 500) });
