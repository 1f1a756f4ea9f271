// The connection to the server: opens it, keeps it alive and reconnects by itself. It does not interpret the game.

import { CloseCode } from '../browser/protocol.js';
import { hello, parse, pong } from './messages.js';

const FIRST_RETRY_MS = 150;
const MAX_RETRY_MS = 2000;
const SILENCE_MS = 5000; // a socket that is silent longer counts as lost: a ping is due every second, in every phase

/** @typedef {'superseded' | 'closed' | 'no_game'} FinalLink no_game: the participant's step is another page now */
/**
 * @typedef {object} Handlers
 * @property {(message: Wire.FromServer) => void} message
 * @property {(link: FinalLink | 'lost', code: number) => void} link
 * @property {(error: unknown) => void} problem
 * @property {() => number} lastTimestep
 */

/**
 * Codes after which the page does not connect again by itself, and what it shows then.
 * @type {Map<number, FinalLink>}
 */
const FINAL_CODES = new Map([
  [CloseCode.SUPERSEDED, 'superseded'],
  [CloseCode.NO_GAME, 'no_game'],
  [CloseCode.REFUSED, 'closed'],
  [CloseCode.NOT_TEXT, 'closed'],
  [CloseCode.TOO_LARGE, 'closed'],
]);

/**
 * Return the ms to wait before a try. The wait doubles, up to 2 s, and is random so that not all pages come at once.
 * @param {number} attempt from 0
 * @param {number} random 0..1
 */
export function retryDelay(attempt, random = Math.random()) {
  return Math.min(MAX_RETRY_MS, FIRST_RETRY_MS * 2 ** attempt) * (0.5 + random / 2);
}

/**
 * Return the name of this tab. It is in sessionStorage only while the page is not shown: a duplicated tab gets its own.
 * @param {Pick<Storage, 'getItem' | 'setItem' | 'removeItem'>} storage
 * @param {EventTarget} page
 */
export function tabName(storage, page = window) {
  const key = 'kitchenmind.tab';
  const bytes = crypto.getRandomValues(new Uint8Array(12));
  const name = storage.getItem(key) ?? Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
  storage.removeItem(key);
  page.addEventListener('pagehide', () => storage.setItem(key, name));
  return name;
}

export class Connection {
  /**
   * @param {URL} url
   * @param {string} tab
   * @param {Handlers} on
   */
  constructor(url, tab, on) {
    this.url = url;
    this.tab = tab;
    this.on = on;
    /** @type {WebSocket | null} */
    this.socket = null;
    this.attempt = 0;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
    this.heardMs = 0;
    /** Whether the socket was silent for too long when it was last looked at. */
    this.suspected = false;
    /** @type {FinalLink | null} */
    this.final = null;
    window.addEventListener('online', () => this.reconnectNow());
    window.addEventListener('offline', () => this.drop());
    setInterval(() => this.#watch(), 1000);
  }

  /** Connect now; this also takes the game over from another tab. */
  open() {
    clearTimeout(this.timer);
    this.final = null;
    this.#release();
    const socket = new WebSocket(this.url);
    this.socket = socket;
    this.heardMs = performance.now();
    this.suspected = false;
    socket.addEventListener('open', () => this.send(hello(this.tab, this.on.lastTimestep())));
    socket.addEventListener('message', (event) => this.#receive(event.data));
    socket.addEventListener('close', (event) => {
      if (this.socket === socket) this.#closed(event.code);
    });
  }

  /**
   * Send a message; return false if no socket is open. Messages are not kept for later, as old key presses are useless.
   * @param {Wire.FromBrowser} message
   */
  send(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /** Try again at once instead of at the next due time, also if the socket has been silent for too long. */
  reconnectNow() {
    if (this.#isSilent()) this.drop();
    if (!this.final && !this.socket) this.open();
  }

  /** Give the socket up as lost. */
  drop() {
    if (!this.socket) return;
    this.#release();
    this.#closed(CloseCode.LOST);
  }

  /** Close for good. */
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

  /** @param {string} frame */
  #receive(frame) {
    this.heardMs = performance.now();
    let message;
    try {
      message = parse(frame);
    } catch (error) {
      this.on.problem(error);
      return;
    }
    if (message.type === 'ping') {
      this.send(pong(message.id));
      return;
    }
    if (message.type === 'welcome') this.attempt = 0;
    if (message.type === 'superseded') this.final = 'superseded';
    if (message.type === 'ended') this.final = 'closed';
    this.on.message(message);
  }

  /** @param {number} code */
  #closed(code) {
    this.socket = null;
    if (code === CloseCode.GAME_READY) {
      this.open();
      return;
    }
    this.final = FINAL_CODES.get(code) ?? this.final;
    if (this.final) {
      this.on.link(this.final, code);
      return;
    }
    this.on.link('lost', code);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.open(), retryDelay(this.attempt));
    this.attempt += 1;
  }

  /** Whether the server should have sent something, or let the socket in, long ago. */
  #isSilent() {
    return this.socket !== null && !this.final && performance.now() - this.heardMs > SILENCE_MS;
  }

  /**
   * Drop a socket that is silent twice in a row: where the page stood still (a tab in the background, a suspended
   * machine), this may run before the messages that arrived in the meantime.
   */
  #watch() {
    const silent = this.#isSilent();
    if (silent && this.suspected) this.drop();
    else this.suspected = silent;
  }
}
