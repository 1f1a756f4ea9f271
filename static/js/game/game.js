// The page of a game: wires the parts together, nothing else. What the page gives: #game-config, #texts (JSON blocks).

import { Announcer } from './announcer.js';
import { Hud } from './hud.js';
import { Keys, Pace, listen, watchPresence } from './input.js';
import { Layout, keyName } from './key-names.js';
import { keysDialog, storedBindings } from './keys-dialog.js';
import { Coach } from './tutorial-coach.js';
import { drawLegend } from '../board/draw-marks.js';
import { away, input, ready } from './messages.js';
import { Overlay } from './dialogs.js';
import { Renderer } from '../board/renderer.js';
import { Connection, tabName } from './connection.js';
import { Sound } from './sound.js';
import { Sprites } from '../board/sprites.js';
import { apply, applyLink, applyTurn, defaults, secondsLeft } from '../board/state.js';
import { session } from '../browser/storage.js';
import { catalogue, jsonBlock } from '../browser/texts.js';
import { listenTouch } from './touch.js';
import { reportTrouble } from './client-errors.js';
import { viewOf } from './choose-dialog.js';

document.documentElement.dataset.runs = 'yes';

const REST_MS = 1500; // a game that stands still is drawn this long after the last change
const VIEW_MS = 200;

const config = jsonBlock('game-config'); // {socket, sprites, lessons, away_s, ready_page}
const text = catalogue(jsonBlock('texts'));
const page = document.querySelector('.game');
const stage = page.querySelector('.stage');
const still = matchMedia('(prefers-reduced-motion: reduce)');

let state = { ...defaults(), linkSinceMs: performance.now() };
let bindings = storedBindings();
let seq = 0;
let leftPage = false; // the server has been told that the participant is away
let startedEpisode = null; // the episode that was started on this page: after a lost connection it goes on by itself
let changedMs = 0, viewedMs = 0, board = null;

const layout = new Layout();
const keys = new Keys(bindings);
const pace = new Pace(press);
const changed = (move) => pace.change(move);
const renderer = new Renderer(page.querySelector('canvas.board'), new Sprites(config.sprites), text('you_tag'));
const hud = new Hud(page, text);
const sound = new Sound(page.querySelector('#sound'), text);
const announcer = new Announcer(page.querySelector('#polite'), page.querySelector('#urgent'), text);
const coach = new Coach(stage, page.querySelector('#coach'), page.querySelector('#lessons'), config.lessons ?? [], text, keyCaps);
const overlay = new Overlay(page, text, { ready: start, takeOver: () => connection.open(), reload: () => location.reload() });
const connection = new Connection(new URL(config.socket, location.href.replace(/^http/, 'ws')), tabName(session), {
  message: receive,
  link: (link) => { letGo(); change(applyLink(state, link === 'no_game' ? leave() : link, performance.now())); },
  problem: (error) => report(error),
  lastTimestep: () => state.current?.t ?? -1,
  expectsNews: () => state.phase === 'playing',
});
const report = reportTrouble((message) => connection.send(message));

/** Takes a new state: shows what hangs on it outside of the canvas. */
function change(next) {
  state = next;
  changedMs = performance.now();
  page.dataset.phase = state.phase;
  page.dataset.link = state.link;
  page.dataset.timestep = state.current?.t ?? '';
  hud.show(state, still.matches);
  renderer.spot = coach.show(state, board);
  view(changedMs);
}

function receive(message) {
  const now = performance.now();
  if (message.type !== 'tick') keysByPhase(message);
  change({ ...apply(state, message, now), awayLimitS: config.away_s });
  if (message.type === 'welcome') welcome(message);
  if (message.type === 'tick') {
    pace.tick();
    const happened = renderer.took(state, now);
    announcer.happened(happened, state);
    announcer.time(secondsLeft(state));
    for (const { kind, seat } of happened) if (seat === undefined || seat === state.game.seat || kind === 'delivery') sound.play(kind);
  }
  if (message.type === 'ended') sound.play('over');
  if (message.type === 'notice') notice(message.text);
}

/** While the game stands still no key counts; old ones never come back. */
function keysByPhase({ type }) {
  if (['paused', 'ended', 'superseded', 'welcome'].includes(type)) letGo();
}

/** Lets all keys go; what the server must be told of it, or null. */
function letGo() {
  const waited = pace.clear();
  return keys.clear() ?? (waited ? { held: null, tap: null } : null);
}

function welcome(message) {
  fit();
  change(state);
  const pressedStart = startedEpisode === message.episode || (message.kind === 'episode' && !message.resumed && config.ready_page && !state.alone);
  if (pressedStart && document.hasFocus() && !document.hidden) start();
}

/** The participant pressed start or came back. */
function start() {
  if (!state.game || !connection.send(ready())) return;
  startedEpisode = state.game.episode;
  leftPage = false;
  stage.focus({ preventScroll: true });
}

/** This page has no game any more: the server knows where to go on. Twice in a row would be a fault, not a way. */
function leave() {
  const last = Number(session.getItem('kitchenmind.left') ?? 0);
  session.setItem('kitchenmind.left', Date.now());
  if (Date.now() - last < 10_000) return 'closed';
  location.reload();
  return 'connecting';
}

function press(move) {
  seq += 1;
  if (!connection.send(input(seq, move.held, move.tap, performance.now()))) return;
  if (move.tap !== null && move.tap < 4) state = applyTurn(state, move.tap, seq);
}

const inPlay = () => state.link === 'open' && ['playing', 'countdown'].includes(state.phase);
const inHand = () => inPlay() && state.game.seat >= 0;

function gameHasFocus() {
  const focused = document.activeElement;
  return inHand() && !document.querySelector('dialog[open]') && (focused === stage || focused === document.body || focused === null);
}

function left(reason) {
  const change = letGo();
  if (!inPlay() || leftPage) return;
  if (change) press(change);
  leftPage = connection.send(away(reason));
}

function back() {
  connection.hurry();
  if (leftPage && state.phase !== 'ended') start();
}

function notice(words) {
  page.querySelector('#notice-text').textContent = words;
  page.querySelector('#notice').hidden = false;
}

function keyCaps() {
  const cap = (words) => Object.assign(document.createElement('kbd'), { textContent: words });
  const group = document.createElement('span');
  group.className = 'capline';
  group.append(...[3, 0, 1, 2].map((action) => cap(keyName(bindings[action][0], text, layout))));
  const touch = matchMedia('(pointer: coarse)').matches;
  return { walk: group, use: cap(touch ? text('keys.use') : keyName(bindings[5][0], text, layout)) };
}

function showCaps() {
  coach.rewrite();
  if (state.game) change(state);
  for (const cap of page.querySelectorAll('kbd[data-action]')) cap.textContent = keyName(bindings[cap.dataset.action][0], text, layout);
}

/** Fits the board into the stage. */
function fit() {
  if (!state.game) return;
  const style = getComputedStyle(stage);
  const cell = renderer.fit(state.game.grid, stage.clientWidth - 2 * parseFloat(style.paddingLeft) - 6, stage.clientHeight - 2 * parseFloat(style.paddingTop) - 6);
  board = { left: renderer.canvas.offsetLeft, top: renderer.canvas.offsetTop, cell };
  coach.moved();
  change(state);
  renderer.draw(state, performance.now(), still.matches); // at once: a canvas of a new size is empty
}

function view(now) {
  viewedMs = now;
  const shown = viewOf(state, now);
  if (page.dataset.second !== `${shown.name}${shown.seconds}` && shown.name === 'count') sound.play('count');
  page.dataset.second = `${shown.name}${shown.seconds}`;
  page.dataset.view = shown.name;
  if (overlay.show(shown, state)) announcer.view(shown, state);
  const usable = inPlay() && shown.name === 'none';
  for (const button of page.querySelectorAll('.touch button')) button.disabled = !usable && shown.name !== 'count';
}

function frame(now) {
  requestAnimationFrame(frame);
  if (state.phase === 'playing' || now - changedMs < REST_MS) renderer.draw(state, now, still.matches);
  if (now - viewedMs > VIEW_MS) view(now);
}

async function begin() {
  listen(keys, gameHasFocus, changed);
  listenTouch(page.querySelector('.touch'), keys, inHand, changed);
  watchPresence(left, back);
  stage.addEventListener('blur', () => { const change = letGo(); if (change) press(change); });
  const showDialog = keysDialog(document.querySelector('#keys-dialog'), page.querySelector('#change-keys'), text, layout, (next) => { bindings = next; keys.bind(next); showCaps(); });
  document.addEventListener('keydown', (event) => layout.learn(event));
  layout.changed = () => { showCaps(); showDialog(); };
  layout.ask();
  const backToGame = () => { if (inPlay()) stage.focus({ preventScroll: true }); };
  page.querySelector('#sound').addEventListener('click', backToGame);
  document.querySelector('#keys-dialog').addEventListener('close', backToGame);
  page.querySelector('#notice button').addEventListener('click', () => { page.querySelector('#notice').hidden = true; backToGame(); });
  showCaps();
  await renderer.sprites.load();
  new ResizeObserver(fit).observe(stage);
  for (const place of page.querySelectorAll('[data-mark]')) drawLegend(place);
  connection.open();
  requestAnimationFrame(frame);
}

begin().catch((error) => {
  report(error);
  document.querySelector('#cannot-run').hidden = false;
});
