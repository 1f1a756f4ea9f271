// The connection to the server: opens it, keeps it, comes back by itself. Knows messages, nothing of what they mean for the game.

import { CloseCode } from '../browser/protocol.js';
import { hello, parse, pong } from './messages.js';

const FIRST_RETRY_MS = 150;
const LONGEST_RETRY_MS = 2000;
const SILENCE_MS = 5000; // a socket that stays silent longer, where ticks or pings are due, is taken for dead

/** Codes after which the page does not connect again by itself, and what the game shows then. */
const FINAL_CODES = new Map([
  [CloseCode.SUPERSEDED, 'superseded'],
  [CloseCode.NO_GAME, 'no_game'],
  [CloseCode.REFUSED, 'closed'],
  [CloseCode.NOT_TEXT, 'closed'],
  [CloseCode.TOO_LARGE, 'closed'],
]);

/** How long to wait before try number `attempt` (from 0): doubles, at most 2 s, spread so that not all come back at one instant. */
export function retryDelay(attempt, random = Math.random()) {
  return Math.min(LONGEST_RETRY_MS, FIRST_RETRY_MS * 2 ** attempt) * (0.5 + random / 2);
}

/** The name of this tab. It lives in sessionStorage only while the page is not shown: a duplicated tab gets a name of its own. */
export function tabName(storage, page = window) {
  const key = 'kitchenmind.tab';
  const name = storage.getItem(key) ?? Array.from(crypto.getRandomValues(new Uint8Array(12)), (byte) => byte.toString(16).padStart(2, '0')).join('');
  storage.removeItem(key);
  page.addEventListener('pagehide', () => storage.setItem(key, name));
  return name;
}

export class Connection {
  /** `on`: {message(message), link('lost' | 'superseded' | 'closed' | 'no_game', code), problem(error), lastTimestep(), expectsNews()}. `no_game`: the
   * participant's step is another page now. */
  constructor(url, tab, on) {
    Object.assign(this, { url, tab, on, socket: null, attempt: 0, timer: 0, heardMs: 0, final: null });
    window.addEventListener('online', () => this.hurry());
    window.addEventListener('offline', () => this.drop());
    setInterval(() => this.#watch(), 1000);
  }

  /** Connects now; also takes the game over from another tab. */
  open() {
    clearTimeout(this.timer);
    this.final = null;
    this.#release();
    const socket = new WebSocket(this.url);
    this.socket = socket;
    this.heardMs = performance.now();
    socket.addEventListener('open', () => this.send(hello(this.tab, this.on.lastTimestep())));
    socket.addEventListener('message', (event) => this.#receive(event.data));
    socket.addEventListener('close', (event) => { if (this.socket === socket) this.#closed(event.code); });
  }

  /** Sends a message; false if there is no open socket (nothing is kept for later: old keys are worth nothing). */
  send(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /** Tries again at once instead of at the next due time. */
  hurry() {
    if (!this.final && !this.socket) this.open();
  }

  /** Gives the socket up as lost. */
  drop() {
    if (!this.socket) return;
    this.#release();
    this.#closed(CloseCode.LOST);
  }

  /** Closes for good. */
  close() {
    this.final = 'closed';
    clearTimeout(this.timer);
    this.#release();
  }

  #release() {
    const socket = this.socket;
    this.socket = null;
    socket?.close(CloseCode.FINISHED);
  }

  #receive(frame) {
    this.heardMs = performance.now();
    let message;
    try {
      message = parse(frame);
    } catch (error) {
      this.on.problem(error);
      return;
    }
    if (message.type === 'ping') { this.send(pong(message.id)); return; }
    if (message.type === 'welcome') this.attempt = 0;
    if (message.type === 'superseded') this.final = 'superseded';
    if (message.type === 'ended') this.final = 'closed';
    this.on.message(message);
  }

  #closed(code) {
    this.socket = null;
    if (code === CloseCode.GAME_READY) { this.open(); return; }
    this.final = FINAL_CODES.get(code) ?? this.final;
    if (this.final) { this.on.link(this.final, code); return; }
    this.on.link('lost', code);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.open(), retryDelay(this.attempt));
    this.attempt += 1;
  }

  #watch() {
    if (this.socket && this.on.expectsNews() && performance.now() - this.heardMs > SILENCE_MS) this.drop();
  }
}
