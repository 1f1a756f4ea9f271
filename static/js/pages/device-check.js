// Checks before consent whether the game will run on this device. The page alone decides; the server only counts, and
// learns nothing about who came.

document.documentElement.dataset.runs = 'yes';

const TRIES = 7, PATIENCE_MS = 8000;
const box = document.getElementById('entry');
const [text, faults, agree, again, unsuitable, decline] = ['entry-text', 'entry-faults', 'agree', 'again', 'unsuitable', 'decline'].map((id) => document.getElementById(id));
const wanted = JSON.parse(box.dataset.checks);
const words = JSON.parse(box.dataset.words);

const counting = `arrival ${box.dataset.count}`;

/** How this tab was counted last; a browser that keeps nothing is counted anew at each visit. */
function counted(now) {
  try {
    const before = sessionStorage.getItem(counting);
    if (now) sessionStorage.setItem(counting, now);
    return before;
  } catch {
    return null;
  }
}

/** Reports a count. The check goes on without it: some privacy settings take `sendBeacon` away, and the game needs neither. */
function count(kind, reason = '') {
  const token = document.querySelector('#consent [name=form_token]').value;
  try {
    const body = new URLSearchParams({ form_token: token, kind, reason });
    if (navigator.sendBeacon?.(box.dataset.count, body)) return;
    fetch(box.dataset.count, { method: 'POST', body, keepalive: true }).catch(() => {});
  } catch (error) {
    console.info(String(error));
  }
}

/** Each tab counts once as opened, and as unsuitable for one reason as long as it is. */
function countCheck(reason) {
  const before = counted(reason || 'good');
  if (before === null) count('opened');
  const failed = before !== null && before !== 'good' && before !== 'declined';
  if (reason && !failed) count('unsuitable', reason);
  if (!reason && failed) count('suitable', before);
}

const fill = (key, numbers) => words[key].replace(/\{(\w+)\}/g, (_, name) => numbers[name]);

function screenFault() {
  const sides = [window.innerWidth, window.innerHeight], needed = [wanted.width, wanted.height];
  const fits = (a, b) => a[0] >= b[0] && a[1] >= b[1];
  return fits(sides, needed) || fits(sides, [...needed].reverse()) ? null : fill('screen', wanted);
}

function inputFault() {
  if (!wanted.input) return null;
  const touch = navigator.maxTouchPoints > 0 || matchMedia('(any-pointer: coarse)').matches;
  const keyboard = matchMedia('(any-hover: hover)').matches || matchMedia('(any-pointer: fine)').matches;
  return touch || keyboard ? null : words.input;
}

/** What a check finds; a check that this browser cannot even run shows that the browser is too old. */
function foundBy(fault) {
  try {
    return fault();
  } catch (error) {
    console.info(String(error));
    return words.browser;
  }
}

/** Tries the game's own code. Loaded late: in a browser that cannot even read it, this page goes on and says so. */
async function browserFault() {
  if (!navigator.cookieEnabled) return words.cookies;
  try {
    (await import('./game-self-test.js')).rehearse();
    return null;
  } catch (error) {
    console.info(String(error));
    return words.browser;
  }
}

/** Round trips over a websocket in ms; rejects when none can be opened. */
function roundTrips() {
  return new Promise((resolve, reject) => {
    const socket = new WebSocket(new URL(box.dataset.socket, location.href.replace(/^http/, 'ws')));
    const times = [];
    let sent = 0;
    const stop = setTimeout(() => { socket.close(); reject(new Error('timeout')); }, PATIENCE_MS);
    const send = () => { sent = performance.now(); socket.send(String(times.length)); };
    socket.onopen = send;
    socket.onmessage = () => {
      times.push(performance.now() - sent);
      if (times.length < TRIES) { send(); return; }
      clearTimeout(stop);
      socket.close();
      resolve(times);
    };
    socket.onerror = () => { clearTimeout(stop); reject(new Error('refused')); };
    socket.onclose = () => { clearTimeout(stop); reject(new Error('closed')); };
  });
}

/** What is wrong with the connection, as [reason, words]; no words where nothing is. */
async function connectionFault() {
  if (!wanted.websocket && !wanted.latency_ms) return ['latency', null];
  try {
    const times = (await roundTrips()).sort((a, b) => a - b);
    const latency = Math.round(times[times.length >> 1]);
    const slow = wanted.latency_ms && latency > wanted.latency_ms;
    return ['latency', slow ? fill('latency', { latency, limit: wanted.latency_ms }) : null];
  } catch {
    return ['websocket', words.websocket];
  }
}

async function check() {
  box.dataset.state = 'waiting';
  text.textContent = words.wait;
  faults.hidden = true;
  const found = [['browser', await browserFault()], ['screen', foundBy(screenFault)], ['input', foundBy(inputFault)], await connectionFault()].filter(([, fault]) => fault);
  const good = found.length === 0;
  countCheck(good ? '' : found[0][0]);
  box.dataset.state = good ? 'good' : 'bad';
  text.textContent = good ? words.good : words.unsuitable_title;
  faults.textContent = ''; // only what every browser with modules has: this page speaks to old ones
  for (const [, fault] of found) faults.appendChild(document.createElement('li')).textContent = fault;
  faults.hidden = good;
  agree.disabled = !good;
  agree.hidden = !good;
  again.hidden = good;
  unsuitable.hidden = good;
  decline.hidden = !good;
}

again.addEventListener('click', check);
decline.addEventListener('click', () => { if (counted('declined') !== 'declined') count('declined'); });
await check();
