// One game for researchers: plays what is stored, and follows what goes on. Wires player, time line, probabilities and downloads.

import { heard, listen } from '../admin/admin-page.js';
import { Film, canFilm } from './video.js';
import { showAccuracy, showChecked, showInputs, showPrediction } from './details.js';
import { Player } from './player.js';
import { TimeLine } from './timeline.js';
import { Renderer } from '../board/renderer.js';
import { Sprites } from '../board/sprites.js';
import { apply, defaults } from '../board/state.js';

const page = document.querySelector('#game').dataset;
const find = (name) => document.querySelector(`#${name}`);
const canvas = find('kitchen');
const renderer = new Renderer(canvas, new Sprites('/static/sprites/'), page.who);
const still = matchMedia('(prefers-reduced-motion: reduce)');
let record = null; // see server/web/admin/replay_page.py
let state = null;
let following = page.live === 'yes' && !location.hash;

const player = new Player((t, by) => show(t, by));
const line = new TimeLine(find('axis'), find('frame'), (t) => go(t));

/** Draws timestep t; `by`: 'step' (the one after the last shown: chefs glide) or 'jump'. */
function show(t, by) {
  const row = record.rows[t];
  if (!row) return;
  const now = performance.now();
  const message = { type: 'tick', state: row.state, prediction: row.displayed, actions: row.actions ?? [4, 4], applied: -1, late: row.late };
  if (by === 'jump' || !state) state = { ...apply(defaults(), { type: 'welcome', ...record.game, state: row.state, endless: !record.game.horizon }, now), phase: 'playing' };
  state = apply({ ...state, phase: 'playing' }, message, now);
  state.game = { ...state.game, tick_ms: Math.max(40, record.game.tick_ms / player.speed) };
  if (by === 'step') renderer.took(state, now);
  find('at').textContent = `t ${t}`;
  find('of').textContent = `of ${record.game.horizon || record.rows.length - 1}, ${(t * record.game.tick_ms / 1000).toFixed(1)} s`;
  find('scrub').value = t;
  find('scrub').setAttribute('aria-valuetext', `timestep ${t}`);
  find('score').textContent = row.state.score;
  showPrediction(find('probs'), find('prediction-t'), record, t);
  showInputs(find('inputs'), find('inputs-t'), record, t);
  line.show(record, t);
  canvas.dataset.timestep = t;
}

function frame(now) {
  requestAnimationFrame(frame);
  if (state) renderer.draw(state, player.playing || following ? now : state.arrivedMs + 1000 * (now - state.arrivedMs > 1200), still.matches);
}

/** To timestep t, standing still. */
function go(t) {
  stay();
  player.go(t, record.rows.length - 1);
  history.replaceState(null, '', `#t=${player.t}`);
}

function stay() {
  following = false;
  player.stop();
  buttons();
}

function buttons() {
  find('play').textContent = player.playing ? '❚❚' : '▶';
  find('play').setAttribute('aria-label', player.playing ? 'Pause' : 'Play');
  find('to-live').setAttribute('aria-pressed', String(following));
}

function fit() {
  if (!record) return;
  const box = canvas.parentElement;
  renderer.fit(record.game.grid, box.clientWidth - 20, Math.max(280, Math.min(420, window.innerHeight * 0.5)));
}

function toggle() {
  following = false;
  if (player.playing) stay();
  else player.play(() => record.rows.length - 1, record.game.tick_ms, buttons);
  buttons();
}

function extent() {
  find('scrub').max = Math.max(0, record.rows.length - 1);
}

async function load() {
  const answer = await fetch(`${page.base}/record.json`, { headers: { accept: 'application/json' } });
  if (!answer.ok) throw new Error((await answer.json()).detail);
  record = await answer.json();
  extent();
  fit();
  showChecked(find('checked'), record);
  showAccuracy(find('accuracy'), record.accuracy);
}

/** A tick of the running game. One that does not follow on what is here means that something was missed. */
async function grow(row, inputs) {
  if (row.t < record.rows.length) return;
  if (row.t > record.rows.length) {
    await load();
  } else {
    record.rows.push(row);
    record.inputs.push(...inputs);
  }
  extent();
  if (following) player.follow(record.rows.length - 1);
}

function follow() {
  listen(`${page.base}/live`, {
    message: (message) => {
      heard();
      if (message.type === 'tick') grow(message.row, message.inputs ?? []);
      if (message.type === 'status') status(message);
      if (message.type === 'over') over();
    },
  });
}

function status({ flag, since_s: since, rtt_ms: rtt, level }) {
  find('now').textContent = level && since !== null ? `${flag}, ${since} s` : flag;
  find('now').className = ['', 'flag warn', 'flag bad'][level];
  find('rtt').textContent = rtt === null ? '–' : `${rtt} ms`;
}

function over() {
  following = false;
  find('live-badge').textContent = 'Over';
  find('live-badge').className = 'badge plain';
  find('to-live').hidden = true;
  find('now').textContent = 'over';
  setTimeout(() => load().then(() => line.show(record, player.t)), 500);
}

function wire() {
  find('play').addEventListener('click', toggle);
  find('to-start').addEventListener('click', () => go(0));
  find('back').addEventListener('click', () => go(player.t - 1));
  find('forward').addEventListener('click', () => go(player.t + 1));
  find('event-back').addEventListener('click', () => go(line.eventBefore(player.t)));
  find('event-forward').addEventListener('click', () => go(line.eventAfter(player.t)));
  find('scrub').addEventListener('input', ({ target }) => go(Number(target.value)));
  find('to-live').addEventListener('click', () => { player.stop(); following = true; player.follow(record.rows.length - 1); buttons(); });
  for (const button of document.querySelectorAll('[data-speed]')) {
    button.addEventListener('click', () => {
      player.speed = Number(button.dataset.speed);
      for (const other of document.querySelectorAll('[data-speed]')) other.setAttribute('aria-pressed', String(other === button));
    });
  }
  find('copy').addEventListener('click', async () => {
    history.replaceState(null, '', `#t=${player.t}`);
    await navigator.clipboard?.writeText(location.href);
    find('copy').textContent = 'Copied';
    setTimeout(() => { find('copy').textContent = 'Copy link'; }, 1500);
  });
  const film = new Film(canvas, page.name, page.who);
  find('picture').addEventListener('click', () => film.picture(player.t));
  find('video').addEventListener('click', () => film.record(find('video'), record, player.t));
  find('video').disabled = !canFilm;
  document.addEventListener('keydown', keys);
  window.addEventListener('hashchange', () => go(fromAddress() ?? player.t));
  new ResizeObserver(() => { fit(); if (record) show(player.t, 'jump'); }).observe(canvas.parentElement);
}

function keys(event) {
  const typing = event.target.closest?.('input:not(#scrub), textarea, select, dialog, button, a');
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  const moves = { ' ': toggle, ArrowLeft: () => go(player.t - 1), ArrowRight: () => go(player.t + 1), Home: () => go(0), End: () => go(record.rows.length - 1) };
  if (!moves[event.key]) return;
  event.preventDefault();
  moves[event.key]();
}

function fromAddress() {
  const found = /^#t=(\d+)$/.exec(location.hash);
  return found ? Number(found[1]) : null;
}

await renderer.sprites.load();
try {
  await load();
  wire();
  requestAnimationFrame(frame);
  if (record.rows.length) player.go(fromAddress() ?? (following ? record.rows.length - 1 : 0), record.rows.length - 1);
  if (page.live === 'yes') follow();
} catch (error) {
  find('checked').textContent = `This record cannot be shown: ${error.message}`;
}
document.querySelector('#game').dataset.ready = 'yes';
