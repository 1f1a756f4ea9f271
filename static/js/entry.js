// Checks before consent whether the game will run on this device. Sends nothing about it: the page alone decides.

const TRIES = 7, PATIENCE_MS = 8000;
const box = document.getElementById('entry');
const [text, faults, agree, again, unsuitable, decline] = ['entry-text', 'entry-faults', 'agree', 'again', 'unsuitable', 'decline'].map((id) => document.getElementById(id));
const wanted = JSON.parse(box.dataset.checks);
const words = JSON.parse(box.dataset.words);

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

async function connectionFault() {
  if (!wanted.websocket && !wanted.latency_ms) return null;
  try {
    const times = (await roundTrips()).sort((a, b) => a - b);
    const latency = Math.round(times[times.length >> 1]);
    return wanted.latency_ms && latency > wanted.latency_ms ? fill('latency', { latency, limit: wanted.latency_ms }) : null;
  } catch {
    return words.websocket;
  }
}

async function check() {
  box.dataset.state = 'waiting';
  text.textContent = words.wait;
  faults.hidden = true;
  const found = [screenFault(), inputFault(), await connectionFault()].filter(Boolean);
  const good = found.length === 0;
  box.dataset.state = good ? 'good' : 'bad';
  text.textContent = good ? words.good : words.unsuitable_title;
  faults.replaceChildren(...found.map((fault) => Object.assign(document.createElement('li'), { textContent: fault })));
  faults.hidden = good;
  agree.disabled = !good;
  agree.hidden = !good;
  again.hidden = good;
  unsuitable.hidden = good;
  decline.hidden = !good;
}

again.addEventListener('click', check);
await check();
