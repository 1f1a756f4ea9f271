// The game page: creates its parts and connects them. The page provides two JSON blocks: #game-config and #texts.

/** @import { State } from '../board/state.js' */
/** @import { Change } from './input.js' */
/** @import { FinalLink } from './connection.js' */
/** @import { PageConfig } from './page-config.js' */
/** @import { BoardBox } from './tutorial-coach.js' */

import { drawLegend } from '../board/draw-marks.js';
import { partnersIntention } from '../board/intention.js';
import { Renderer } from '../board/renderer.js';
import { Sprites } from '../board/sprites.js';
import { apply, applyLink, applyTurn, defaults, secondsLeft } from '../board/state.js';
import { find, findAll } from '../browser/dom.js';
import { session } from '../browser/storage.js';
import { catalogue, jsonBlock } from '../browser/texts.js';
import { Announcer } from './announcer.js';
import { chooseDialog } from './choose-dialog.js';
import { reportClientErrors } from './client-errors.js';
import { Connection, tabName } from './connection.js';
import { Dialogs } from './dialogs.js';
import { flyDeliveries } from './flying-points.js';
import { Hud } from './hud.js';
import { InputPacer, Keys, releaseAll } from './input.js';
import { absence, listenToKeyboard, watchPresence } from './keyboard.js';
import { storedBindings } from './keys-dialog.js';
import { MarksControl } from './marks-control.js';
import { MarksHelp } from './marks-help.js';
import { away, input, ready } from './messages.js';
import { ResearcherNotice } from './notice.js';
import { OwnKeys } from './own-keys.js';
import { inOwnLanguage, withNewsOfPartner } from './page-config.js';
import { reloadOnce } from './reload-once.js';
import { Sound } from './sound.js';
import { listenTouch } from './touch.js';
import { TutorialCoach } from './tutorial-coach.js';

document.documentElement.dataset.runs = 'yes';

const REST_MS = 1500; // a paused game is drawn for this long after the last change
const STILL_MS = 100; // with reduced motion, an unchanged game is drawn again after this time
const DIALOG_MS = 200;
const BOARD_FRAME = 6; // CSS pixels around the board

/** @type {PageConfig} */
const config = jsonBlock('game-config');
const text = catalogue(jsonBlock('texts'));
const page = find('.game', HTMLElement);
const stage = find('.stage', HTMLElement, page);
const still = matchMedia('(prefers-reduced-motion: reduce)');

/** @type {State} */
let state = { ...defaults(), linkSinceMs: performance.now(), awayLimitS: config.away_s };
let seq = 0;
/** Whether the server has been told that the participant is away. */
let leftPage = false;
/** @type {string | null} the episode that was started on this page: after a lost connection it resumes by itself */
let startedEpisode = null;
let [changedMs, drawnMs, dialogMs] = [0, 0, 0];
/** @type {BoardBox | null} */
let board = null;

const keys = new Keys(storedBindings());
const ownKeys = new OwnKeys(page, keys, text, keysChanged);
const lessonKeyCaps = () => ownKeys.caps();
const pacer = new InputPacer(press);
/** @param {Change} change */
const changed = (change) => pacer.change(change);
const releaseKeys = () => releaseAll(keys, pacer);
const renderer = new Renderer(
  find('canvas.board', HTMLCanvasElement, page),
  new Sprites(config.sprites),
  text('you_tag'),
);
renderer.text = text;
const hud = new Hud(page, text);
const sound = new Sound(find('#sound', HTMLElement, page), text);
const announcer = new Announcer(find('#polite', HTMLElement, page), find('#urgent', HTMLElement, page), text);
const notice = new ResearcherNotice(find('#notice', HTMLElement, page), stage, backToGame, (words) =>
  announcer.sayNow(words),
);
const bubble = find('#coach', HTMLElement, page);
const coach = new TutorialCoach(
  stage,
  bubble,
  find('#lessons', HTMLElement, page),
  config.lessons ?? [],
  text,
  lessonKeyCaps,
);
const marksControl = new MarksControl(document.body, text, lessonKeyCaps);
const marksHelp = new MarksHelp(
  find('#marks-help', HTMLDialogElement),
  findAll('.marks-help-open', HTMLButtonElement, page),
  renderer.sprites,
  text,
);
const dialogs = new Dialogs(
  page,
  text,
  {
    ready: start,
    takeOver: () => connection.open(),
    reload: () => location.reload(),
  },
  config.rounds ?? [],
);
const connection = new Connection(new URL(config.socket, location.href.replace(/^http/, 'ws')), tabName(session), {
  message: receive,
  link: linkChanged,
  problem: (error) => report(error),
  lastTimestep: () => state.current?.t ?? -1,
});
const report = reportClientErrors((message) => connection.send(message));

/**
 * Set a new state and update the parts of the page outside the canvas.
 * @param {State} next
 */
function change(next) {
  state = next;
  changedMs = performance.now();
  page.dataset.phase = state.phase;
  page.dataset.link = state.link;
  page.dataset.timestep = String(state.current?.t ?? '');
  hud.show(state, still.matches);
  marksControl.show(state);
  marksHelp.offer(state);
  renderer.highlight = coach.show(state, board);
  showDialog(changedMs);
}

/** @param {Wire.FromServer} received */
function receive(received) {
  const message = inOwnLanguage(received, config);
  const now = performance.now();
  // While the game is paused no key counts, and old keys do not act later.
  if (['paused', 'ended', 'superseded', 'welcome'].includes(message.type)) releaseKeys();
  const next = withNewsOfPartner(apply(state, message, now), message, config);
  if (message.type === 'welcome') welcome(message, next);
  else change(next);
  if (message.type === 'tick') tick(now);
  if (message.type === 'ended') sound.play('over');
  if (message.type === 'notice') notice.show(message.text);
  const reason = message.type === 'countdown' ? absence() : null;
  if (reason) left(reason); // the game must not begin with nobody there, even if no event told that they left
}

/** @param {number} now */
function tick(now) {
  pacer.tick();
  const happened = renderer.applyEvents(state, now);
  renderer.effects.pointsFly = !still.matches;
  if (!still.matches) flyDeliveries(page, renderer.canvas, state, happened);
  announcer.happened(happened, state);
  announcer.time(secondsLeft(state));
  announcer.intention(partnersIntention(state, text));
  for (const { kind, seat } of happened) {
    if (seat === undefined || seat === state.game?.seat || kind === 'delivery') sound.play(kind);
  }
}

/** @param {FinalLink | 'lost'} link */
function linkChanged(link) {
  releaseKeys();
  change(applyLink(state, link === 'no_game' ? reloadOnce() : link, performance.now()));
}

/** @type {(message: Wire.Welcome, next: State) => void} */
function welcome(message, next) {
  keys.marksOnDemand = message.show !== 'always';
  const onReadyPage = message.kind === 'episode' && !message.resumed && config.ready_page && !next.alone;
  const starting = (startedEpisode === message.episode || onReadyPage) && !absence();
  change({ ...next, starting }); // with a start dialog that disappears at once somebody would try to press its button
  fit();
  if (starting) start();
}

/** The participant pressed start or came back. */
function start() {
  if (!state.game || !connection.send(ready())) return;
  startedEpisode = state.game.episode;
  leftPage = false;
  change({ ...state, starting: true });
  stage.focus({ preventScroll: true });
}

/** @param {Change} change */
function press(change) {
  seq += 1;
  if (!connection.send(input(seq, change.held, change.tap, performance.now(), change.marks))) return;
  if (change.tap !== null && change.tap < 4) state = applyTurn(state, change.tap, seq);
}

const inPlay = () => state.link === 'open' && ['playing', 'countdown'].includes(state.phase);

/** Whether an absence counts: the participant has pressed start, and the game is not over. It may be paused. */
function hasStarted() {
  return state.link === 'open' && startedEpisode === state.game?.episode && state.phase !== 'ended';
}

const controlsChef = () => inPlay() && state.game !== null && state.game.seat >= 0;

function gameHasFocus() {
  const focused = document.activeElement;
  const onPage = focused === stage || focused === document.body || focused === null;
  return onPage && controlsChef() && !document.querySelector('dialog[open]');
}

/** @param {Wire.Away['reason']} reason */
function left(reason) {
  const change = releaseKeys();
  if (!hasStarted() || leftPage) return;
  if (change) press(change);
  leftPage = connection.send(away(reason));
}

function back() {
  connection.reconnectNow();
  if (leftPage && state.phase !== 'ended') start();
}

function keysChanged() {
  coach.rewrite();
  marksControl.rewrite();
  if (state.game) change(state);
}

/** Fit the board into the stage. */
function fit() {
  if (!state.game) return;
  const style = getComputedStyle(stage);
  const width = stage.clientWidth - 2 * parseFloat(style.paddingLeft) - BOARD_FRAME;
  const height = stage.clientHeight - 2 * parseFloat(style.paddingTop) - BOARD_FRAME;
  const cell = renderer.fit(state.game.grid, width, height);
  board = { left: renderer.canvas.offsetLeft, top: renderer.canvas.offsetTop, cell };
  coach.moved();
  change(state);
  renderer.draw(state, performance.now(), still.matches); // at once: a canvas of a new size is empty
}

/** @param {number} now */
function showDialog(now) {
  dialogMs = now;
  const dialog = chooseDialog(state, now);
  const second = `${dialog.name}${dialog.seconds}`;
  if (page.dataset.second !== second && dialog.name === 'count') sound.play('count');
  page.dataset.second = second;
  page.dataset.view = dialog.name;
  if (dialogs.show(dialog, state)) announcer.dialog(dialog, state);
  hud.call(document.hidden && dialog.name === 'start' && state.game?.partner === 'human');
  const usable = inPlay() && dialog.name === 'none';
  for (const button of findAll('.touch button', HTMLButtonElement, page)) {
    button.disabled = !usable && dialog.name !== 'count';
  }
}

/** @param {number} now */
function frame(now) {
  requestAnimationFrame(frame);
  const isCurrent = still.matches && drawnMs >= changedMs && now - drawnMs < STILL_MS;
  if (!isCurrent && (state.phase === 'playing' || now - changedMs < REST_MS)) {
    renderer.draw(state, now, still.matches);
    drawnMs = performance.now();
  }
  if (now - dialogMs > DIALOG_MS) showDialog(now);
}

function backToGame() {
  if (inPlay()) stage.focus({ preventScroll: true });
}

function listenToKeys() {
  listenToKeyboard(keys, gameHasFocus, changed);
  listenTouch(find('.touch', HTMLElement, page), keys, controlsChef, changed);
  watchPresence(left, back);
  stage.addEventListener('blur', () => {
    const change = releaseKeys();
    if (change) press(change);
  });
}

async function begin() {
  listenToKeys();
  ownKeys.offer();
  for (const each of findAll('dialog', HTMLDialogElement)) each.addEventListener('close', backToGame);
  find('#sound', HTMLElement, page).addEventListener('click', backToGame);
  ownKeys.show();
  await renderer.sprites.load();
  new ResizeObserver(fit).observe(stage);
  for (const place of findAll('[data-mark]', HTMLElement, page)) drawLegend(place);
  connection.open();
  requestAnimationFrame(frame);
}

begin().catch((error) => {
  report(error);
  find('#cannot-run', HTMLElement).hidden = false;
});
