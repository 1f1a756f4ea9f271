// The messages between browser and server, as docs/reference/protocol.md describes them: what is sent is built here, what comes is
// checked here. Knows no socket.

import { PROTOCOL } from '../browser/protocol.js';

const number = (value) => typeof value === 'number' && Number.isFinite(value);
const text = (value) => typeof value === 'string';
const flag = (value) => typeof value === 'boolean';
const listOf = (check) => (value) => Array.isArray(value) && value.every(check);
const numbers = (length) => (value) => Array.isArray(value) && value.length === length && value.every(number);
const shape = (fields) => (value) => typeof value === 'object' && value !== null && wrongField(value, fields) === null;

const KITCHEN = {
  t: number, players: listOf(numbers(4)), counters: listOf(numbers(3)), pots: listOf(numbers(4)), score: number, soups: number,
};

const INCOMING = {
  welcome: {
    protocol: number, episode: text, kind: text, number, episodes: number, layout: text, title: text, grid: listOf(text),
    seat: number, watched_seat: number, horizon: number, tick_ms: number, steps: number, shows_predictions: flag,
    state: shape(KITCHEN), resumed: flag, endless: flag, partner: text,
  },
  waiting: { left_s: number },
  countdown: { seconds: number },
  tick: { state: shape(KITCHEN), prediction: listOf(numbers(2)), actions: numbers(2), applied: number, late: flag },
  paused: { reason: text, left_s: number },
  lesson: { key: text, index: number, steps: number, done: flag },
  ended: { score: number, soups: number, progress: number, passed: flag, next: text, reason: text },
  ping: { id: number },
  notice: { text },
  refused: { code: text, reason: text },
  superseded: {},
};

/** The first field of `value` that is missing or of the wrong type; null if all are well. */
function wrongField(value, fields) {
  for (const [name, check] of Object.entries(fields)) if (!check(value[name])) return name;
  return null;
}

/** The message in a frame of the server. Throws TypeError that names what is wrong. */
export function parse(frame) {
  const message = JSON.parse(frame);
  const fields = Object.keys(INCOMING).includes(message?.type) ? INCOMING[message.type] : null;
  if (!fields) throw new TypeError(`unknown message ${String(message?.type)}`);
  const wrong = wrongField(message, fields);
  if (wrong !== null) throw new TypeError(`${message.type}: bad field ${wrong}`);
  return message;
}

export const hello = (tab, lastTimestep) => ({ type: 'hello', protocol: PROTOCOL, tab, last_timestep: lastTimestep });
export const ready = () => ({ type: 'ready' });
export const input = (seq, held, tap, clientMs) => ({ type: 'input', seq, held, tap, client_ms: clientMs });
export const away = (reason) => ({ type: 'away', reason });
export const pong = (id) => ({ type: 'pong', id });
export const trouble = (problem) => ({ type: 'trouble', text: String(problem).slice(0, 500) });
