// The introduction one slide at a time, each with a small kitchen. Without this script all slides stand below each other.

import { EAST, INTERACT, NORTH, SOUTH, WEST } from '../board/kitchen.js';
import { Layout } from '../game/key-names.js';
import { Scene } from '../board/scene.js';
import { session } from '../browser/storage.js';

const GRID = ['XXPXXXX', 'X     D', 'O     X', 'X     S', 'XXXXXXX'];
const CRATE = [0, 2], POT = [2, 0], HATCH = [6, 3];
const NOTHING = 0, ONION = 1, DISH = 2, SOUP = 3;
const FRAME_MS = 1000;

/** Every moment: own chef, AI chef as [x, y, facing, held]; pots as [x, y, onions, tick]. */
const moment = (me, ai, more = {}) => ({ players: [me, ai], ...more });
const pot = (onions, tick = -1) => ({ pots: [[...POT, onions, tick]] });
const far = [5, 3, NORTH, NOTHING], near = [5, 2, NORTH, NOTHING];

const SCENES = {
  team: [moment([2, 2, SOUTH, NOTHING], [4, 2, SOUTH, NOTHING])],
  fetch: [
    moment([3, 2, WEST, NOTHING], far, { mark: CRATE }), moment([2, 2, WEST, NOTHING], far, { mark: CRATE }),
    moment([1, 2, WEST, NOTHING], far, { mark: CRATE }), moment([1, 2, WEST, ONION], far),
  ],
  fill: [moment([2, 1, NORTH, ONION], near, { ...pot(2), mark: POT }), moment([2, 1, NORTH, NOTHING], near, pot(3, 1))],
  wait: [4, 9, 14, 20].map((tick) => moment([2, 1, NORTH, NOTHING], near, pot(3, tick))),
  deliver: [
    moment([5, 1, EAST, DISH], [3, 3, WEST, NOTHING], pot(3, 20)), moment([2, 1, NORTH, SOUP], [3, 3, WEST, NOTHING]),
    moment([4, 3, EAST, SOUP], [2, 3, WEST, NOTHING], { mark: HATCH }), moment([5, 3, EAST, SOUP], [2, 3, WEST, NOTHING], { mark: HATCH }),
  ],
  marks: [
    [[4, 3, WEST, ONION], [NORTH, NORTH, WEST]], [[4, 2, NORTH, ONION], [NORTH, WEST, WEST]],
    [[4, 1, NORTH, ONION], [WEST, WEST, NORTH]], [[3, 1, WEST, ONION], [WEST, NORTH, INTERACT]],
  ].map(([ai, steps]) => moment([2, 3, EAST, NOTHING], ai, { ...pot(2), prediction: steps.map((action, k) => [action, [95, 80, 60][k]]) })),
};

const form = document.getElementById('slides');
const slides = [...form.querySelectorAll('.slide')];
const [back, next, finish, dots, canvas] = ['back', 'next', 'finish', 'dots', 'scene'].map((id) => document.getElementById(id));
const still = matchMedia('(prefers-reduced-motion: reduce)');
const key = `slide:${form.dataset.key}`;
let here = Math.min(slides.length - 1, Number(session.getItem(key)) || 0);
let timer = 0;
let scene = null;

function show(index, focus = false) {
  here = index;
  session.setItem(key, index);
  slides.forEach((slide, k) => { slide.hidden = k !== index; });
  back.hidden = index === 0;
  next.hidden = index === slides.length - 1;
  finish.hidden = !next.hidden;
  [...dots.querySelectorAll('button')].forEach((dot, k) => (k === index ? dot.setAttribute('aria-current', 'step') : dot.removeAttribute('aria-current')));
  if (focus) (next.hidden ? finish : next).focus();
  play();
}

/** One moment a second; with reduced motion only the last one, which shows the outcome. */
function play() {
  clearInterval(timer);
  if (!scene) return;
  const frames = SCENES[slides[here].dataset.slide];
  canvas.setAttribute('aria-label', slides[here].querySelector('h1, h2').textContent);
  let frame = still.matches ? frames.length - 1 : 0;
  scene.show(GRID, frames[frame]);
  if (still.matches || frames.length === 1) return;
  timer = setInterval(() => {
    frame = (frame + 1) % frames.length;
    scene.show(GRID, frames[frame]);
  }, FRAME_MS);
}

/** The letters to walk with as they are printed on this keyboard: ZQSD in France. */
let letters = 'WASD';
function showLetters() {
  const printed = [...'WASD'].map((letter) => layout.of(`Key${letter}`) ?? letter).join('');
  for (const text of form.querySelectorAll('#slide-fetch .text')) text.textContent = text.textContent.replace(letters, printed);
  letters = printed;
}

const layout = new Layout(showLetters);
showLetters();
layout.ask();
document.addEventListener('keydown', (event) => layout.learn(event));

form.classList.add('one');
dots.hidden = false;
next.addEventListener('click', () => show(here + 1, true));
back.addEventListener('click', () => show(here - 1, true));
[...dots.querySelectorAll('button')].forEach((dot, k) => dot.addEventListener('click', () => show(k)));
form.addEventListener('submit', () => session.removeItem(key));
still.addEventListener('change', play);
show(here);
scene = await Scene.open(canvas, form.dataset.you);
play();
