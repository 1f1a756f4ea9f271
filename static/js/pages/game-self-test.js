// Tries whether this browser can run the game, with the game's own code: every module is loaded, and a few moments of a
// game are parsed, drawn and played on an invisible canvas. Features that cannot be tried here are looked up by name.

/** @import { State } from '../board/state.js' */
/** @import { Catalogue } from '../browser/texts.js' */
/** @import { Change } from '../game/input.js' */

import { drawLegend } from '../board/draw-marks.js';
import { Renderer } from '../board/renderer.js';
import { Sprites, blank } from '../board/sprites.js';
import { apply, applyLink, applyTurn, defaults, isStarted, secondsLeft } from '../board/state.js';
import { tickOf } from '../board/still-board.js';
import { session } from '../browser/storage.js';
import { catalogue } from '../browser/texts.js';
import { Announcer } from '../game/announcer.js';
import { chooseDialog } from '../game/choose-dialog.js';
import { reportClientErrors } from '../game/client-errors.js';
import { Connection, retryDelay, tabName } from '../game/connection.js';
import { Dialogs } from '../game/dialogs.js';
import { flight } from '../game/flying-points.js';
import { Hud } from '../game/hud.js';
import { DEFAULT_BINDINGS, InputPacer, Keys } from '../game/input.js';
import { keyCaps } from '../game/key-caps.js';
import { KeyboardLayout } from '../game/key-names.js';
import { listenToKeyboard } from '../game/keyboard.js';
import { rebind } from '../game/keys-dialog.js';
import { MarksControl } from '../game/marks-control.js';
import { MarksHelp } from '../game/marks-help.js';
import { parse } from '../game/messages.js';
import { readingMs } from '../game/notice.js';
import { OwnKeys } from '../game/own-keys.js';
import { inOwnLanguage } from '../game/page-config.js';
import { reloadOnce } from '../game/reload-once.js';
import { showBowls } from '../game/result.js';
import { Sound } from '../game/sound.js';
import { listenTouch } from '../game/touch.js';
import { bubblePlace, target } from '../game/tutorial-coach.js';

const GRID = ['XPXX', 'O12D', 'X  X', 'XXSX'];
const LESSONS = ['walk', 'fetch', 'fill', 'wait', 'plate', 'deliver', 'marks'];
/** @type {[number, number][][]} every action */
const PREDICTIONS = [
  [0, 1, 2],
  [3, 4, 5],
  [6, 6, 6],
].map((actions) => actions.map((action, step) => [action, [95, 80, 60][step]]));
/** @type {Wire.Tick['intention'][]} */
const INTENTIONS = [
  [4, 1, 0, 95],
  [7, 3, 2, 60],
  [8, -1, -1, 95],
];
const ONION = 1;
const SOUP = 3;
const MODULES = [
  Hud,
  Dialogs,
  Connection,
  Sound,
  Sprites,
  listenToKeyboard,
  listenTouch,
  reportClientErrors,
  MarksControl,
  MarksHelp,
  OwnKeys,
  inOwnLanguage,
  flight,
  reloadOnce,
  showBowls,
];

/**
 * Features that the game and the other pages use but the self-test does not try: name -> whether the browser has it.
 * @type {Record<string, () => boolean>}
 */
const NEEDS = {
  WebSocket: () => typeof WebSocket === 'function' && WebSocket.OPEN === 1, // even if the study file skips it
  dialog: () => typeof HTMLDialogElement.prototype.showModal === 'function',
  ResizeObserver: () => typeof new ResizeObserver(() => {}).observe === 'function',
  requestAnimationFrame: () => typeof requestAnimationFrame === 'function',
  matchMedia: () => typeof matchMedia('(prefers-reduced-motion: reduce)').addEventListener === 'function',
  'Image.decode': () => typeof new Image().decode === 'function',
  'crypto.getRandomValues': () => crypto.getRandomValues(new Uint8Array(1)).length === 1,
  'Element.replaceChildren': () => typeof Element.prototype.replaceChildren === 'function',
  'Element.closest': () => document.createElement('i').closest('i') !== null,
  'classList.toggle': () => document.createElement('i').classList.toggle('a', true),
  'document.hasFocus': () => typeof document.hasFocus() === 'boolean',
  elementFromPoint: () => typeof document.elementFromPoint === 'function',
  PointerEvent: () => typeof PointerEvent === 'function',
  FormData: () => [...new FormData()].length === 0,
  URL: () => new URL('/a', location.href).pathname === '/a' && [...new URLSearchParams('a=1').keys()].length === 1,
  modules: () => MODULES.every((part) => typeof part === 'function'),
};

/** Throws an Error that names what is missing or went wrong. */
export function runSelfTest() {
  for (const [name, has] of Object.entries(NEEDS)) if (!has()) throw new Error(`this browser has no ${name}`);
  tryTexts();
  tryKeys();
  tryGame(new Renderer(blank(4, 4), new EmptySprites(''), 'YOU'));
}

/** Drawings without pictures: nothing is fetched. */
class EmptySprites extends Sprites {
  /**
   * @param {string} name
   * @param {number} pixels
   */
  at(name, pixels) {
    return this.raster(`${name}@${pixels}`, pixels, pixels, () => {});
  }
}

function tryTexts() {
  /** @type {Catalogue} */
  const text = catalogue({ 'keys.space': 'Space', 'say.seconds': '{seconds} s' });
  text.nodes('say.seconds', { seconds: document.createElement('kbd') });
  keyCaps(DEFAULT_BINDINGS, text, new KeyboardLayout());
  new Announcer(document.createElement('p'), document.createElement('p'), text).time(9);
  session.getItem('kitchenmind.tab');
  tabName({ getItem: () => null, setItem() {}, removeItem() {} }, new EventTarget());
  retryDelay(1);
  if (!(readingMs('请稍等') > 0)) throw new Error('no time to read a message');
  const place = document.createElement('i');
  place.dataset.mark = 'hand';
  drawLegend(place);
}

function tryKeys() {
  const keys = new Keys();
  /** @type {Change[]} */
  const sent = [];
  const bindings = { 0: ['ArrowUp'], 1: ['ArrowDown'], 2: ['ArrowRight'], 3: ['ArrowLeft'], 5: ['Space'] };
  keys.bind(rebind(bindings, '0', 'KeyI'));
  const pacer = new InputPacer((change) => sent.push(change), 1);
  for (const code of ['KeyI', 'ArrowLeft', 'Space']) {
    const change = keys.press(code);
    if (change) pacer.change(change);
  }
  keys.release('ArrowLeft');
  keys.clear();
  pacer.tick();
  if (sent.length < 2 || sent[0].held !== 0) throw new Error('keys do not work');
}

/** @type {Wire.Welcome} */
const WELCOME = {
  ...{ type: 'welcome', protocol: 1, episode: 'self-test', kind: 'tutorial', number: 1, episodes: 1, layout: 'test' },
  ...{ title: 'Test', grid: GRID, seat: 0, watched_seat: 1, horizon: 400, tick_ms: 200, steps: 3, resumed: false },
  ...{ shows_predictions: true, state: kitchen(0, ONION), endless: false, partner: 'agent' },
  ...{ show: 'always', view_radius: 1, partner_seen: true, unknown: [], asked: true, display: 'both' },
  away_s: 30,
};

/** @param {Renderer} renderer */
function tryGame(renderer) {
  let now = 1000;
  /** @type {State} */
  let state = defaults();
  /** @param {Wire.FromServer} message */
  const receive = (message) => {
    now += 200;
    state = apply(state, parse(JSON.stringify(message)), now);
  };
  receive(WELCOME);
  renderer.fit(GRID, 128, 128);
  receive({ type: 'countdown', seconds: 3, away_s: 30 });
  receive({ type: 'paused', reason: 'blur', left_s: 3 });
  PREDICTIONS.forEach((prediction, step) => {
    const after = kitchen(step + 1, step % 2 ? 0 : SOUP);
    /** @type {Partial<Wire.Tick>} */
    const seen = { partner_seen: step < 2, unknown: [[0, 2]] };
    receive(tickOf({ state: after, prediction, actions: [step, 5], intention: INTENTIONS[step], ...seen }));
    renderer.applyEvents(state, now);
    for (const still of [false, true]) renderer.draw(applyTurn(state, 2, 1), now + 50, still);
  });
  tryLessons(renderer, state, now);
  receive({ type: 'ended', score: 20, soups: 1, progress: 0, passed: true, next: '/', reason: 'horizon' });
  if (secondsLeft(state) === undefined || !chooseDialog(applyLink(state, 'lost', now), now).name) {
    throw new Error('the game does not end');
  }
}

/**
 * @param {Renderer} renderer
 * @param {State} state
 * @param {number} now
 */
function tryLessons(renderer, state, now) {
  if (!isStarted(state)) throw new Error('the game does not start');
  const board = { left: 0, top: 0, cell: 32 };
  for (const key of LESSONS) {
    renderer.highlight = target(key, state);
    renderer.draw(state, now, false);
    bubblePlace(renderer.highlight, state, board, { width: 40, height: 20 }, { width: 128, height: 128 });
  }
}

/**
 * @param {number} t
 * @param {number} held
 * @returns {Wire.KitchenState}
 */
function kitchen(t, held) {
  return {
    t,
    players: [
      [1, 1, 0, held],
      [2, 1, 1, 0],
    ],
    counters: [[0, 2, 1]],
    pots: [[1, 0, 3, 19 + t]],
    score: t * 20,
    soups: t,
  };
}
