// Whether this browser can run the game, tried with the game's own code: every module is loaded, and a few moments of a
// game are parsed, drawn and played on a canvas that nobody sees. What cannot be tried here is looked up by name.

import { Announcer } from '../game/announcer.js';
import { Hud } from '../game/hud.js';
import { Keys, Pace } from '../game/input.js';
import { keyName } from '../game/key-names.js';
import { rebind } from '../game/keys-dialog.js';
import { bubblePlace, target } from '../game/tutorial-coach.js';
import { drawLegend } from '../board/draw-marks.js';
import { parse } from '../game/messages.js';
import { Overlay } from '../game/dialogs.js';
import { Renderer } from '../board/renderer.js';
import { Connection, retryDelay, tabName } from '../game/connection.js';
import { Sound } from '../game/sound.js';
import { Sprites, blank } from '../board/sprites.js';
import { apply, applyLink, applyTurn, defaults, secondsLeft } from '../board/state.js';
import { session } from '../browser/storage.js';
import { catalogue } from '../browser/texts.js';
import { listenTouch } from '../game/touch.js';
import { reportTrouble } from '../game/client-errors.js';
import { viewOf } from '../game/choose-dialog.js';

const GRID = ['XPXX', 'O12D', 'X  X', 'XXSX'];
const LESSONS = ['walk', 'fetch', 'fill', 'wait', 'plate', 'deliver', 'marks'];
const FORMS = [[[0, 95], [1, 80], [2, 60]], [[3, 95], [4, 80], [5, 60]], [[6, 95], [6, 80], [6, 60]]]; // every action
const ONION = 1, SOUP = 3;

/** What the game and the other pages use and the rehearsal does not: name -> whether the browser has it. */
const NEEDS = {
  WebSocket: () => typeof WebSocket === 'function' && WebSocket.OPEN === 1, // whatever the study file leaves unchecked
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
  MODULES: () => [Hud, Overlay, Connection, Sound, Sprites, listenTouch, reportTrouble].every((part) => typeof part === 'function'),
};

/** Throws an Error that names what is missing or went wrong. */
export function rehearse() {
  for (const [name, has] of Object.entries(NEEDS)) if (!has()) throw new Error(`this browser has no ${name}`);
  words();
  keys();
  game(new Renderer(blank(4, 4), new Drawings(), 'YOU'));
}

/** Drawings without pictures: nothing is fetched. */
class Drawings extends Sprites {
  at(name, pixels) {
    return this.raster(`${name}@${pixels}`, pixels, pixels, () => {});
  }
}

function words() {
  const text = catalogue({ 'keys.space': 'Space', 'say.seconds': '{seconds} s' });
  text.nodes('say.seconds', { seconds: document.createElement('kbd') });
  keyName('KeyW', text);
  new Announcer(document.createElement('p'), document.createElement('p'), text).time(9);
  session.getItem('kitchenmind.tab');
  tabName({ getItem: () => null, removeItem() {} }, { addEventListener() {} });
  retryDelay(1);
  const place = document.createElement('i');
  place.dataset.mark = 'hand';
  drawLegend(place);
}

function keys() {
  const all = new Keys(), sent = [];
  all.bind(rebind({ 0: ['ArrowUp'], 1: ['ArrowDown'], 2: ['ArrowRight'], 3: ['ArrowLeft'], 5: ['Space'] }, '0', 'KeyI'));
  const pace = new Pace((move) => sent.push(move), 1);
  for (const code of ['KeyI', 'ArrowLeft', 'Space']) pace.change(all.press(code));
  all.release('ArrowLeft');
  all.clear();
  pace.tick();
  if (sent.length < 2 || sent[0].held !== 0) throw new Error('keys do not work');
}

function game(renderer) {
  let now = 1000, state = { ...defaults(), awayLimitS: 30 };
  const receive = (message) => { now += 200; state = apply(state, parse(JSON.stringify(message)), now); };
  receive({
    type: 'welcome', protocol: 1, episode: 'rehearsal', kind: 'tutorial', number: 1, episodes: 1, layout: 'rehearsal', title: 'Rehearsal', grid: GRID,
    seat: 0, watched_seat: 1, horizon: 400, tick_ms: 200, steps: 3, shows_predictions: true, state: kitchen(0, ONION), resumed: false, endless: false, partner: 'agent',
  });
  renderer.fit(GRID, 128, 128);
  receive({ type: 'countdown', seconds: 3 });
  receive({ type: 'paused', reason: 'blur', left_s: 3 });
  FORMS.forEach((prediction, step) => {
    receive({ type: 'tick', state: kitchen(step + 1, step % 2 ? 0 : SOUP), prediction, actions: [step, 5], applied: -1, late: false });
    renderer.took(state, now);
    for (const still of [false, true]) renderer.draw(applyTurn(state, 2, 1), now + 50, still);
  });
  for (const key of LESSONS) {
    renderer.spot = target(key, state);
    renderer.draw(state, now, false);
    bubblePlace(renderer.spot, state, { left: 0, top: 0, cell: 32 }, { width: 40, height: 20 }, { width: 128, height: 128 });
  }
  receive({ type: 'ended', score: 20, soups: 1, progress: 0, passed: true, next: '/', reason: 'horizon' });
  if (secondsLeft(state) === undefined || !viewOf(applyLink(state, 'lost', now), now).name) throw new Error('the game does not end');
}

function kitchen(t, held) {
  return { t, players: [[1, 1, 0, held], [2, 1, 1, 0]], counters: [[0, 2, 1]], pots: [[1, 0, 3, 19 + t]], score: t * 20, soups: t };
}
