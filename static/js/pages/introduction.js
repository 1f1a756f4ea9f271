// Shows the introduction one slide at a time, each with a small kitchen. Without this script all slides are visible.

/** @import { Cell, Player } from '../board/kitchen.js' */
/** @import { Moment } from '../board/scene.js' */

import { DISH, EAST, INTERACT, NORTH, SOUP, SOUTH, WEST } from '../board/kitchen.js';
import { Scene } from '../board/scene.js';
import { find, findAll } from '../browser/dom.js';
import { session } from '../browser/storage.js';
import { catalogue, fillIn, jsonBlock } from '../browser/texts.js';
import { KeyboardLayout } from '../game/key-names.js';

const GRID = ['XXPXXXX', 'X     D', 'O     X', 'X     S', 'XXXXXXX'];
/** @type {Cell} */
const CRATE = [0, 2];
/** @type {Cell} */
const POT = [2, 0];
/** @type {Cell} */
const HATCH = [6, 3];
const NOTHING = 0;
const ONION = 1;
const OPACITIES = [95, 80, 60];
const FRAME_MS = 1000;
const SWIPE_PX = 50;

/** @type {(own: Player, ai: Player, more?: Partial<Moment>) => Moment} */
const moment = (own, ai, more = {}) => ({ ...more, players: [own, ai] });
/** @type {(onions: number, cooking?: number) => Partial<Moment>} */
const pot = (onions, cooking = -1) => ({ pots: [[...POT, onions, cooking]] });
/** @type {(own: Player, steps: number[]) => Moment} */
const predicted = (ai, steps) => {
  return moment([2, 3, EAST, NOTHING], ai, { ...pot(2), prediction: steps.map((step, k) => [step, OPACITIES[k]]) });
};
/** @type {Wire.Tick['intention']} */
const FILLS_POT = [4, ...POT, OPACITIES[0]];
/** @type {Player} */
const FAR = [5, 3, NORTH, NOTHING];
/** @type {Player} */
const NEAR = [5, 2, NORTH, NOTHING];

/** @type {Record<string, Moment[]>} */
const SCENES = {
  team: [moment([2, 2, SOUTH, NOTHING], [4, 2, SOUTH, NOTHING])],
  fetch: [
    moment([3, 2, WEST, NOTHING], FAR, { mark: CRATE }),
    moment([2, 2, WEST, NOTHING], FAR, { mark: CRATE }),
    moment([1, 2, WEST, NOTHING], FAR, { mark: CRATE }),
    moment([1, 2, WEST, ONION], FAR),
  ],
  fill: [moment([2, 1, NORTH, ONION], NEAR, { ...pot(2), mark: POT }), moment([2, 1, NORTH, NOTHING], NEAR, pot(3, 1))],
  wait: [4, 9, 14, 20].map((cooking) => moment([2, 1, NORTH, NOTHING], NEAR, pot(3, cooking))),
  deliver: [
    moment([5, 1, EAST, DISH], [3, 3, WEST, NOTHING], pot(3, 20)),
    moment([2, 1, NORTH, SOUP], [3, 3, WEST, NOTHING]),
    moment([4, 3, EAST, SOUP], [2, 3, WEST, NOTHING], { mark: HATCH }),
    moment([5, 3, EAST, SOUP], [2, 3, WEST, NOTHING], { mark: HATCH }),
  ],
  marks: [
    predicted([4, 3, WEST, ONION], [NORTH, NORTH, WEST]),
    predicted([4, 2, NORTH, ONION], [NORTH, WEST, WEST]),
    predicted([4, 1, NORTH, ONION], [WEST, WEST, NORTH]),
    predicted([3, 1, WEST, ONION], [WEST, NORTH, INTERACT]),
  ],
};

const form = find('#slides', HTMLFormElement);
const { display = 'actions', steps = '3' } = form.dataset;
for (const each of SCENES.marks) each.prediction = each.prediction?.slice(0, Number(steps));
if (display === 'intention') for (const each of SCENES.marks) delete each.prediction;
if (['intention', 'both'].includes(display)) for (const each of SCENES.marks) each.intention = FILLS_POT;
const slides = findAll('.slide', HTMLElement, form);
const back = find('#back', HTMLButtonElement);
const next = find('#next', HTMLButtonElement);
const finish = find('#finish', HTMLButtonElement);
const dots = find('#dots', HTMLElement);
const dotButtons = findAll('button', HTMLButtonElement, dots);
const canvas = find('#scene', HTMLCanvasElement);
const still = matchMedia('(prefers-reduced-motion: reduce)');
const key = `slide:${form.dataset.key}`;
let here = Math.min(slides.length - 1, Number(session.getItem(key)) || 0);
/** @type {ReturnType<typeof setInterval> | undefined} */
let timer = undefined;
/** @type {Scene | null} */
let scene = null;

/**
 * @param {number} index
 * @param {boolean} focus
 */
function show(index, focus = false) {
  here = index;
  session.setItem(key, index);
  slides.forEach((slide, k) => {
    slide.hidden = k !== index;
  });
  back.hidden = index === 0;
  next.hidden = index === slides.length - 1;
  finish.hidden = !next.hidden;
  dotButtons.forEach((dot, k) => {
    if (k === index) dot.setAttribute('aria-current', 'step');
    else dot.removeAttribute('aria-current');
  });
  if (focus) (next.hidden ? finish : next).focus();
  play();
}

/** Show one moment a second; with reduced motion only the last one, which shows the outcome. */
function play() {
  clearInterval(timer);
  if (!scene) return;
  const shown = scene;
  const frames = SCENES[slides[here].dataset.slide ?? ''];
  canvas.setAttribute('aria-label', find('h1, h2', HTMLElement, slides[here]).textContent ?? '');
  let frame = still.matches ? frames.length - 1 : 0;
  shown.show(GRID, frames[frame]);
  if (still.matches || frames.length === 1) return;
  timer = setInterval(() => {
    frame = (frame + 1) % frames.length;
    shown.show(GRID, frames[frame]);
  }, FRAME_MS);
}

if (matchMedia('(pointer: coarse)').matches) {
  for (const text of findAll('.text[data-touch]', HTMLElement, form)) text.textContent = text.dataset.touch ?? '';
}

let letters = 'WASD';

/**
 * Turn one slide on or back, if there is one.
 * @param {number} by
 */
function turn(by) {
  if (here + by >= 0 && here + by < slides.length) show(here + by, true);
}

/** @param {KeyboardEvent} event */
function turnByKey(event) {
  const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (by === undefined || event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
  event.preventDefault();
  turn(by);
}

/** A finger that moves sideways turns the slide; one that scrolls does not. */
function turnBySwipe() {
  /** @type {Touch | null} */
  let from = null;
  form.addEventListener('touchstart', (event) => (from = event.touches.length === 1 ? event.touches[0] : null), {
    passive: true,
  });
  form.addEventListener('touchend', (event) => {
    if (!from) return;
    const [x, y] = [event.changedTouches[0].clientX - from.clientX, event.changedTouches[0].clientY - from.clientY];
    from = null;
    if (Math.abs(x) >= SWIPE_PX && Math.abs(x) > 2 * Math.abs(y)) turn(x < 0 ? 1 : -1);
  });
}

/** Name the letters as they are printed on this keyboard: ZQSD to walk with in France. */
function showLetters() {
  for (const text of findAll('.text.ask', HTMLElement, form)) {
    if (text.textContent !== text.dataset.touch) {
      text.textContent = fillIn(text.dataset.words ?? '', { key: layout.of('KeyQ') ?? 'Q' });
    }
  }
  const printed = [...'WASD'].map((letter) => layout.of(`Key${letter}`) ?? letter).join('');
  for (const text of findAll('#slide-fetch .text', HTMLElement, form)) {
    text.textContent = (text.textContent ?? '').replace(letters, printed);
  }
  letters = printed;
}

const layout = new KeyboardLayout(showLetters);
showLetters();
layout.ask();
document.addEventListener('keydown', (event) => layout.learn(event));
document.addEventListener('keydown', turnByKey);
turnBySwipe();

form.classList.add('one');
dots.hidden = false;
next.addEventListener('click', () => show(here + 1, true));
back.addEventListener('click', () => show(here - 1, true));
dotButtons.forEach((dot, k) => dot.addEventListener('click', () => show(k)));
form.addEventListener('submit', () => session.removeItem(key));
still.addEventListener('change', play);
show(here);
scene = await Scene.open(canvas, form.dataset.you ?? '');
scene.renderer.text = catalogue(jsonBlock('texts'));
play();
