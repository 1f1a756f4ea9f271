// One game for researchers: plays what is stored and follows a running game.

/** @import { State } from '../board/state.js' */
/** @import { Move } from './player.js' */

import { listen } from '../admin/live-socket.js';
import { Renderer } from '../board/renderer.js';
import { Sprites } from '../board/sprites.js';
import { apply } from '../board/state.js';
import { boardState } from '../board/still-board.js';
import { SPRITES } from '../browser/addresses.js';
import { find, findAll } from '../browser/dom.js';
import { catalogue, jsonBlock } from '../browser/texts.js';
import { frameOf, showAccuracy, showInputs, showIntentions, showPrediction, showVerification } from './details.js';
import { onKeys } from './keys.js';
import { showLive, showOver, showPauser, showStatus } from './live-status.js';
import { Player } from './player.js';
import { TimeLine, timestepInAddress } from './timeline.js';
import { VideoExport, canRecordVideo, noVideoWords } from './video.js';

const MIN_TICK_MS = 40;
const COPIED_MS = 1500;
const LOAD_AGAIN_MS = 500; // after this time, the end of a game is stored

/** @param {string} id */
const place = (id) => find(`#${id}`, HTMLElement);
const game = place('game');
const { base = '', name = '', who = '', live } = game.dataset;
const canvas = find('#kitchen', HTMLCanvasElement);
const scrubber = find('#scrub', HTMLInputElement);
const videoButton = find('#video', HTMLButtonElement);
const renderer = new Renderer(canvas, new Sprites(SPRITES), who);
const text = catalogue(jsonBlock('texts'));
renderer.greysOldMarks = false;
renderer.text = text;
renderer.outlinesView = true;
const still = matchMedia('(prefers-reduced-motion: reduce)');
/** @type {State | null} */
let state = null;
let isLive = live === 'yes';
let following = isLive && !location.hash;

const player = new Player(show);
const line = new TimeLine(place('axis'), place('frame'), go);

/** @returns {Promise<Researcher.EpisodeRecord>} */
async function fetchRecord() {
  const answer = await fetch(`${base}/record.json`, { headers: { accept: 'application/json' } });
  if (!answer.ok) throw new Error((await answer.json()).detail);
  return answer.json();
}

/** @type {Researcher.EpisodeRecord} */
let record;

function lastTimestep() {
  return record.rows.length - 1;
}

/**
 * Draw timestep t. After a step the chefs glide.
 * @param {number} t
 * @param {Move} by
 */
function show(t, by) {
  const row = record.rows[t];
  if (!row) return;
  drawRow(row, by);
  const seconds = ((t * record.game.tick_ms) / 1000).toFixed(1);
  place('at').textContent = `t ${t}`;
  place('of').textContent = `of ${record.game.horizon || lastTimestep()}, ${seconds} s`;
  scrubber.value = String(t);
  scrubber.setAttribute('aria-valuetext', `timestep ${t}`);
  place('score').textContent = String(row.state.score);
  showPrediction(place('probs'), place('prediction-t'), record, t);
  showIntentions(place('intentions'), record, t, text);
  showInputs(place('inputs'), place('inputs-t'), record, t);
  line.show(record, t);
  canvas.dataset.timestep = String(t);
}

/**
 * @param {Researcher.Row} row
 * @param {Move} by
 */
function drawRow(row, by) {
  const now = performance.now();
  const before = by === 'jump' || !state ? boardState(record.game, row.state, now) : state;
  state = apply(before, frameOf(row), now);
  if (state.game) {
    const tickMs = Math.max(MIN_TICK_MS, record.game.tick_ms / player.speed);
    state = { ...state, game: { ...state.game, tick_ms: tickMs } };
  }
  if (by === 'step') renderer.applyEvents(state, now);
  else renderer.forgetEffects();
}

/**
 * Draw the board; in a paused replay without motion, with all chefs in their cells and all marks in full.
 * @param {number} now
 */
function frame(now) {
  requestAnimationFrame(frame);
  if (state) renderer.draw(state, now, still.matches || !(player.playing || following));
}

/**
 * Stop and show timestep t.
 * @param {number} t
 */
function go(t) {
  stop();
  player.go(t, lastTimestep());
  history.replaceState(null, '', `#t=${player.t}`);
}

function stop() {
  following = false;
  player.stop();
  showButtons();
}

function showButtons() {
  place('play').textContent = player.playing ? '❚❚' : '▶';
  place('play').setAttribute('aria-label', player.playing ? 'Pause' : 'Play');
  place('to-live').setAttribute('aria-pressed', String(following));
}

function fit() {
  const width = (canvas.parentElement ?? canvas).clientWidth - 20;
  renderer.fit(record.game.grid, width, Math.max(280, Math.min(420, window.innerHeight * 0.5)));
}

function togglePlay() {
  following = false;
  if (player.playing) stop();
  else player.play(lastTimestep, record.game.tick_ms, showButtons);
  showButtons();
}

/** The slider has the length of the axis below it: that of the whole episode, also while it runs. */
function showExtent() {
  scrubber.max = String(Math.max(0, record.game.horizon || lastTimestep()));
}

async function load() {
  record = await fetchRecord();
  showRecord();
}

function showRecord() {
  showExtent();
  fit();
  showVerification(place('checked'), record);
  showAccuracy(place('accuracy'), record.accuracy, record.intention_accuracy);
}

/**
 * Add a tick of the running game. If it is not the next one, ticks were missed: load the whole record.
 * @param {Researcher.Row} row
 * @param {Researcher.Input[]} inputs
 */
async function grow(row, inputs) {
  if (row.t < record.rows.length) return;
  if (row.t > record.rows.length) {
    await load();
  } else {
    record.rows.push(row);
    record.inputs.push(...inputs);
  }
  showExtent();
  if (following) player.follow(lastTimestep());
}

function listenToGame() {
  listen(`${base}/live`, {
    message: (/** @type {Researcher.Replay} */ message) => {
      if (message.type === 'tick') grow(message.row, message.inputs ?? []);
      if (message.type === 'status') showStatus(place('now'), place('rtt'), message);
      if (message.type === 'status' && message.id && !isLive) begins();
      if (message.type === 'paused') showPauser(message.by);
      if (message.type === 'over') over();
    },
  });
}

/** The participant is back: the game was not played when the page was opened. */
function begins() {
  isLive = true;
  following = !location.hash && !player.playing;
  showLive();
  showButtons();
}

function over() {
  following = false;
  showOver();
  setTimeout(async () => {
    await load();
    line.show(record, player.t);
  }, LOAD_AGAIN_MS);
}

/**
 * @param {string} id
 * @param {() => void} action
 */
function onClick(id, action) {
  place(id).addEventListener('click', action);
}

function connectTransport() {
  onClick('play', togglePlay);
  onClick('to-start', () => go(0));
  onClick('back', () => go(player.t - 1));
  onClick('forward', () => go(player.t + 1));
  onClick('event-back', () => go(line.eventBefore(player.t)));
  onClick('event-forward', () => go(line.eventAfter(player.t)));
  scrubber.addEventListener('input', () => go(Number(scrubber.value)));
  onClick('to-live', () => {
    player.stop();
    following = true;
    player.follow(lastTimestep());
    showButtons();
  });
  const speeds = findAll('[data-speed]', HTMLElement);
  for (const button of speeds) {
    button.addEventListener('click', () => {
      player.speed = Number(button.dataset.speed);
      for (const other of speeds) other.setAttribute('aria-pressed', String(other === button));
    });
  }
}

function connectDownloads() {
  onClick('copy', copyLink);
  const video = new VideoExport(name, who, text);
  onClick('picture', () => video.picture(record, player.t));
  onClick('video', () => video.record(videoButton, place('video-note'), record, player.t));
  videoButton.disabled = !canRecordVideo;
  place('video-note').hidden = canRecordVideo;
  place('video-note').textContent = canRecordVideo ? '' : noVideoWords;
}

async function copyLink() {
  history.replaceState(null, '', `#t=${player.t}`);
  await navigator.clipboard?.writeText(location.href);
  place('copy').textContent = 'Copied';
  setTimeout(() => {
    place('copy').textContent = 'Copy link';
  }, COPIED_MS);
}

function begin() {
  connectTransport();
  connectDownloads();
  onKeys({
    ' ': togglePlay,
    ArrowLeft: () => go(player.t - 1),
    ArrowRight: () => go(player.t + 1),
    Home: () => go(0),
    End: () => go(lastTimestep()),
  });
  window.addEventListener('hashchange', () => go(timestepInAddress() ?? player.t));
  new ResizeObserver(() => {
    fit();
    show(player.t, 'jump');
  }).observe(canvas.parentElement ?? canvas);
  requestAnimationFrame(frame);
  if (record.rows.length) player.go(timestepInAddress() ?? (following ? lastTimestep() : 0), lastTimestep());
  if (live !== 'over') listenToGame();
}

/**
 * Show a record that is not stored here, from the start.
 * @param {Researcher.EpisodeRecord} opened
 */
export function open(opened) {
  const isFirst = !record;
  if (!isFirst) stop();
  record = opened;
  state = null;
  showRecord();
  if (isFirst) begin();
  else player.go(0, lastTimestep());
}

await renderer.sprites.load();
try {
  if (base) {
    await load();
    begin();
  }
} catch (error) {
  place('checked').textContent = `This record cannot be shown: ${error instanceof Error ? error.message : error}`;
}
game.dataset.ready = 'yes';
