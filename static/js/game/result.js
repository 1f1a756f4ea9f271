// The result of a round: a bowl for each soup, and the participant's own points over the rounds.

/** @import { Catalogue } from '../browser/texts.js' */

const MAX_BOWLS = 24;
const WIDTH = 300;
const HEIGHT = 96;
const PAD = { left: 16, right: 16, top: 24, bottom: 20 };
const SVG = 'http://www.w3.org/2000/svg';

/** @typedef {{ number: number, score: number }} RoundScore */

/**
 * Show a bowl for each soup, next to the number as text.
 * @param {HTMLElement} place
 * @param {HTMLImageElement} bowl
 * @param {number} soups
 */
export function showBowls(place, bowl, soups) {
  const bowls = Array.from({ length: Math.min(soups, MAX_BOWLS) }, () => bowl.cloneNode());
  const more = document.createElement('span');
  more.textContent = soups > MAX_BOWLS ? `+${soups - MAX_BOWLS}` : '';
  place.replaceChildren(...bowls, more);
  place.hidden = !soups;
}

/**
 * Draw the points of all rounds so far as a curve with a text alternative; nothing for a first round.
 * @param {HTMLElement} place
 * @param {RoundScore[]} rounds oldest first
 * @param {Catalogue} text
 */
export function showCurve(place, rounds, text) {
  place.hidden = rounds.length < 2;
  if (place.hidden) return;
  const label = rounds.map(({ number, score }) => text('over.curve.round', { number, score })).join(' ');
  const points = pointsOf(rounds);
  const picture = svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img', 'aria-label': label }, [
    svg('path', { class: 'ground', d: `M0 ${HEIGHT - PAD.bottom} H${WIDTH}` }),
    svg('polyline', { points: points.map(({ x, y }) => `${x},${y}`).join(' ') }),
    ...points.flatMap(({ x, y, score, number }, k) => dotAndWords(x, y, score, number, k === points.length - 1)),
  ]);
  const title = document.createElement('figcaption');
  title.textContent = text('over.curve.title');
  place.replaceChildren(title, picture);
}

/** @param {RoundScore[]} rounds */
function pointsOf(rounds) {
  const most = Math.max(20, ...rounds.map(({ score }) => score));
  const [wide, high] = [WIDTH - PAD.left - PAD.right, HEIGHT - PAD.top - PAD.bottom];
  return rounds.map(({ number, score }, k) => ({
    ...{ number, score },
    x: Math.round(PAD.left + (wide * k) / (rounds.length - 1)),
    y: Math.round(PAD.top + high * (1 - score / most)),
  }));
}

/** @type {(x: number, y: number, score: number, number: number, isLast: boolean) => Element[]} */
function dotAndWords(x, y, score, number, isLast) {
  const kind = isLast ? 'now' : 'before';
  const words = svg('text', { x, y: y - 9, class: kind });
  const round = svg('text', { x, y: HEIGHT - 5, class: 'round' });
  words.textContent = String(score);
  round.textContent = String(number);
  return [svg('circle', { cx: x, cy: y, r: isLast ? 5.5 : 4, class: kind }), words, round];
}

/** @type {(name: string, attributes: Record<string, string | number>, children?: Element[]) => Element} */
function svg(name, attributes, children = []) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  element.append(...children);
  return element;
}
