// Checks before consent whether the game will run on this device. The page alone decides. The server only counts, and
// does not learn who came.

import { find } from '../browser/dom.js';
import { fillIn } from '../browser/texts.js';

document.documentElement.dataset.runs = 'yes';

const ECHOES = 7;
const TIMEOUT_MS = 8000;
const box = find('#entry', HTMLElement);
const text = find('#entry-text', HTMLElement);
const faults = find('#entry-faults', HTMLElement);
const agree = find('#agree', HTMLButtonElement);
const again = find('#again', HTMLElement);
const unsuitable = find('#unsuitable', HTMLElement);
const decline = find('#decline', HTMLElement);
const { checks, words: texts, count: countAddress = '', socket: echoAddress = '' } = box.dataset;
/** @type {{ width: number, height: number, input: boolean, websocket: boolean, latency_ms: number | null }} */
const wanted = JSON.parse(checks ?? '{}');
/** @type {Record<string, string>} */
const words = JSON.parse(texts ?? '{}');

const countedKey = `arrival ${countAddress}`;

/**
 * Return how this tab was counted last, and store how it is counted now. A browser that stores nothing is counted again
 * at each visit.
 * @param {string} now
 */
function counted(now) {
  try {
    const before = sessionStorage.getItem(countedKey);
    if (now) sessionStorage.setItem(countedKey, now);
    return before;
  } catch {
    return null;
  }
}

/**
 * @param {'opened' | 'unsuitable' | 'suitable' | 'declined'} kind
 * @param {string} reason
 * Some privacy settings remove `sendBeacon`; neither the check nor the game needs it.
 */
function count(kind, reason = '') {
  const token = find('#consent [name=form_token]', HTMLInputElement).value;
  try {
    const body = new URLSearchParams({ form_token: token, kind, reason });
    if (navigator.sendBeacon?.(countAddress, body)) return;
    fetch(countAddress, { method: 'POST', body, keepalive: true }).catch(() => {});
  } catch (error) {
    console.info(String(error));
  }
}

/**
 * Count each tab once as opened, and once as unsuitable for as long as it is.
 * @param {string} reason '' if the device is suitable
 */
function countCheck(reason) {
  const before = counted(reason || 'good');
  if (before === null) count('opened');
  const failed = before !== null && before !== 'good' && before !== 'declined';
  if (reason && !failed) count('unsuitable', reason);
  if (!reason && failed) count('suitable', before);
}

function screenFault() {
  const { innerWidth: width, innerHeight: height } = window;
  const upright = width >= wanted.width && height >= wanted.height;
  const turned = width >= wanted.height && height >= wanted.width;
  return upright || turned ? null : fillIn(words.screen, wanted);
}

function inputFault() {
  if (!wanted.input) return null;
  const touch = navigator.maxTouchPoints > 0 || matchMedia('(any-pointer: coarse)').matches;
  const keyboard = matchMedia('(any-hover: hover)').matches || matchMedia('(any-pointer: fine)').matches;
  return touch || keyboard ? null : words.input;
}

/**
 * Run one check. If the browser cannot even run it, the browser is too old.
 * @param {() => string | null} fault
 */
function foundBy(fault) {
  try {
    return fault();
  } catch (error) {
    console.info(String(error));
    return words.browser;
  }
}

/** Try the game's own code. It is imported only here, so that this page runs where that code cannot be parsed. */
async function browserFault() {
  if (!navigator.cookieEnabled) return words.cookies;
  try {
    (await import('./game-self-test.js')).runSelfTest();
    return null;
  } catch (error) {
    console.info(String(error));
    return words.browser;
  }
}

/**
 * Return round trips over a websocket in ms. Rejects if none can be opened.
 * @returns {Promise<number[]>}
 */
function roundTrips() {
  return new Promise((resolve, reject) => {
    const socket = new WebSocket(new URL(echoAddress, location.href.replace(/^http/, 'ws')));
    /** @type {number[]} */
    const times = [];
    let sent = 0;
    const timer = setTimeout(() => finish(giveUp), TIMEOUT_MS);
    const send = () => {
      sent = performance.now();
      socket.send(String(times.length));
    };
    const giveUp = () => {
      if (times.length === 0) reject(new Error('timeout'));
      else resolve([...times, performance.now() - sent]); // it works, but slowly
    };
    /** @param {() => void} settle */
    const finish = (settle) => {
      clearTimeout(timer);
      socket.close();
      settle();
    };
    socket.onopen = send;
    socket.onmessage = () => {
      times.push(performance.now() - sent);
      if (times.length < ECHOES) send();
      else finish(() => resolve(times));
    };
    socket.onerror = () => finish(() => reject(new Error('refused')));
    socket.onclose = () => finish(() => reject(new Error('closed')));
  });
}

/** @typedef {[reason: string, words: string | null]} Fault no words: nothing is wrong */

/**
 * Check the connection.
 * @returns {Promise<Fault>}
 */
async function connectionFault() {
  if (!wanted.websocket && !wanted.latency_ms) return ['latency', null];
  try {
    const times = (await roundTrips()).sort((a, b) => a - b);
    const latency = Math.round(times[times.length >> 1]);
    const slow = wanted.latency_ms && latency > wanted.latency_ms;
    return ['latency', slow ? fillIn(words.latency, { latency, limit: wanted.latency_ms }) : null];
  } catch {
    return ['websocket', words.websocket];
  }
}

async function check() {
  box.dataset.state = 'waiting';
  text.textContent = words.wait;
  faults.hidden = true;
  /** @type {Fault[]} */
  const all = [
    ['browser', await browserFault()],
    ['screen', foundBy(screenFault)],
    ['input', foundBy(inputFault)],
    await connectionFault(),
  ];
  show(all.filter(([, fault]) => fault));
}

/** @param {Fault[]} found */
function show(found) {
  const good = found.length === 0;
  countCheck(good ? '' : found[0][0]);
  box.dataset.state = good ? 'good' : 'bad';
  text.textContent = good ? words.good : words.unsuitable_title;
  faults.textContent = ''; // no replaceChildren here: this page must also run in old browsers
  for (const [, fault] of found) faults.appendChild(document.createElement('li')).textContent = fault;
  faults.hidden = good;
  agree.disabled = !good;
  agree.hidden = !good;
  again.hidden = good;
  unsuitable.hidden = good;
  decline.hidden = !good;
}

again.addEventListener('click', check);
decline.addEventListener('click', () => {
  if (counted('declined') !== 'declined') count('declined');
});
await check();
