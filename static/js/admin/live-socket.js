// Keeps a websocket of a researcher's page open and shows how old its news is: "Live, 0.4 s ago".

import { find } from '../browser/dom.js';
import { CloseCode } from '../browser/protocol.js';

const OLD_MS = 3000;
const LOST_MS = 10_000;
const FIRST_RETRY_MS = 250;
const MAX_RETRY_MS = 5000;
const SHOW_AGE_MS = 200;

/** @type {number | null} */
let heardMs = null;

/**
 * Keep a websocket open for as long as the page is open. If the session has ended, the sign-in page is loaded.
 * @param {string} path
 * @param {{ message(message: any): void, open?(send: (message: object) => void): void }} on
 * @param {number} attempt
 */
export function listen(path, on, attempt = 0) {
  const socket = new WebSocket(new URL(path, location.href.replace(/^http/, 'ws')));
  const openedMs = performance.now();
  let tries = attempt;
  /** @param {object} message */
  const send = (message) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  };
  socket.addEventListener('open', () => on.open?.(send));
  socket.addEventListener('message', ({ data }) => {
    heardMs = performance.now();
    if (heardMs - openedMs > MAX_RETRY_MS) tries = 0; // else it may fail again: wait longer
    on.message(JSON.parse(data));
  });
  socket.addEventListener('close', ({ code }) => {
    if (code === CloseCode.FINISHED) return;
    if (code === CloseCode.SIGNED_OUT) location.reload();
    else setTimeout(() => listen(path, on, tries + 1), Math.min(MAX_RETRY_MS, FIRST_RETRY_MS * 2 ** tries));
  });
}

setInterval(() => {
  if (heardMs === null) return;
  const age = performance.now() - heardMs;
  const place = find('#age', HTMLElement);
  place.textContent = `Live, ${(age / 1000).toFixed(1)} s ago`;
  place.className = `nowrap ${age > LOST_MS ? 'dead' : age > OLD_MS ? 'old' : ''}`;
}, SHOW_AGE_MS);
