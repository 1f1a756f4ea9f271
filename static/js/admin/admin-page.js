// What every page of a researcher has: buttons that ask first in a dialog, and "Live, 0.4 s ago". Knows no study.

import { CloseCode } from '../browser/protocol.js';

const OLD_MS = 3000, DEAD_MS = 10_000;

for (const button of document.querySelectorAll('[data-ask]')) {
  button.addEventListener('click', () => document.querySelector(`#ask-${button.dataset.ask}`).showModal());
}
for (const button of document.querySelectorAll('[data-close]')) {
  button.addEventListener('click', () => button.closest('dialog').close());
}
for (const form of document.querySelectorAll('dialog form')) {
  form.addEventListener('submit', () => setTimeout(() => form.closest('dialog').close(), 0));
}

let heardMs = null;

/** The page has just heard from the server. */
export function heard() {
  heardMs = performance.now();
}

/** Keeps a websocket open for as long as the page is; `on`: {message(object), open(send)}. Final closes lead to the sign-in page. */
export function listen(path, on, attempt = 0) {
  const socket = new WebSocket(new URL(path, location.href.replace(/^http/, 'ws')));
  const send = (wish) => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(wish)); };
  let tries = attempt;
  socket.addEventListener('open', () => on.open?.(send));
  socket.addEventListener('message', ({ data }) => { tries = 0; heard(); on.message(JSON.parse(data)); });
  socket.addEventListener('close', ({ code }) => {
    if (code === CloseCode.FINISHED) return;
    if (code === CloseCode.SIGNED_OUT) { location.reload(); return; }
    setTimeout(() => listen(path, on, tries + 1), Math.min(5000, 250 * 2 ** tries));
  });
}

setInterval(() => {
  if (heardMs === null) return;
  const age = performance.now() - heardMs;
  const place = document.querySelector('#age');
  place.textContent = `Live, ${(age / 1000).toFixed(1)} s ago`;
  place.className = `nowrap ${age > DEAD_MS ? 'dead' : age > OLD_MS ? 'old' : ''}`;
}, 200);

/** An element with text, a class and children; what comes from participants only ever becomes text. */
export function make(tag, { text, className, ...rest } = {}, ...children) {
  const element = document.createElement(tag);
  if (text !== undefined && text !== null) element.textContent = text;
  if (className) element.className = className;
  for (const [name, value] of Object.entries(rest)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** 75 -> 1:15 */
export function clock(seconds) {
  return `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, '0')}`;
}

/** 0.7843 -> 78.4 */
export const percent = (share) => (100 * share).toFixed(1);
