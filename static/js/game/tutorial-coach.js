// The tutorial's coach: the list of lessons, the bubble that explains one, and the cell that it points at.

/** @import { Cell } from '../board/kitchen.js' */
/** @import { StartedState, State } from '../board/state.js' */
/** @import { Catalogue } from '../browser/texts.js' */

import { COOK_TIME, DISH, SOUP, cellsOf, isFloor } from '../board/kitchen.js';
import { isStarted } from '../board/state.js';
import { find } from '../browser/dom.js';

/** @typedef {{ width: number, height: number }} Size */
/** @typedef {{ left: number, top: number, cell: number }} BoardBox the board in the stage's pixels; cell: its side */
/** @typedef {{ side: 'below' | 'above' | 'free', left: number, top: number }} Place */

const GAP = 14;
const MARGIN = 8;
/** The cost of hiding a pot or the own chef: more than hiding all the floor. */
const VITAL = 100;
const MARKS_REACH = 3; // cells: a mark for each of the next steps

/**
 * Return the cell that a lesson points at now, as a function of the lesson and what is on screen; null for none.
 * @param {string} key of the lesson
 * @param {StartedState} state
 * @returns {Cell | null}
 */
export function target(key, state) {
  const { grid, seat, watched_seat: watched } = state.game;
  const { players, pots } = state.current;
  const own = players[seat];
  /** @type {(cells: [number, number, ...number[]][]) => [number, number, ...number[]] | null} */
  const nearest = (cells) => [...cells].sort((a, b) => distance(a, own) - distance(b, own))[0] ?? null;
  const cooking = pots.filter(([, , , time]) => time >= 0);
  const ready = nearest(cooking.filter(([, , , time]) => time >= COOK_TIME));
  const filling = nearest(pots.filter(([, , onions, time]) => time < 0 && onions > 0)) ?? nearest(cellsOf(grid, 'P'));
  /** @type {Record<string, () => readonly number[] | null>} */
  const places = {
    fetch: () => nearest(cellsOf(grid, 'O')),
    fill: () => (own[3] === 0 ? nearest(cellsOf(grid, 'O')) : filling),
    wait: () => nearest(cooking) ?? filling,
    plate: () => (own[3] === DISH ? (ready ?? nearest(cooking)) : nearest(cellsOf(grid, 'D'))),
    deliver: () => (own[3] === SOUP ? nearest(cellsOf(grid, 'S')) : null),
    marks: () => (state.partnerSeen ? players[watched] : null),
  };
  const place = places[key]?.();
  return place ? [place[0], place[1]] : null;
}

/** @type {(a: readonly number[], b: readonly number[]) => number} */
function distance([x, y], [otherX, otherY]) {
  return Math.abs(x - otherX) + Math.abs(y - otherY);
}

/**
 * Return where a bubble hides least of the kitchen; `tip` is where its arrow points, from its left edge.
 * @param {Cell | null} cell
 * @param {StartedState} state
 * @param {BoardBox} board
 * @param {Size} size of the bubble
 * @param {Size} stage
 * @returns {Place & { tip: number }}
 */
export function bubblePlace(cell, state, board, size, stage) {
  const centre = cell ? board.left + (cell[0] + 0.5) * board.cell : stage.width / 2;
  const left = clamp(centre - size.width / 2, MARGIN, stage.width - size.width - MARGIN);
  const lowest = stage.height - size.height - MARGIN;
  const above = board.top + (cell?.[1] ?? -1) * board.cell; // the upper edge of the cell
  const top = cell ? above : board.top + state.game.grid.length * board.cell;
  /** @type {Place[]} */
  const options = [
    { side: 'below', left, top: above + board.cell + GAP },
    { side: 'above', left, top: top - size.height - GAP },
  ];
  if (!cell) options.push({ side: 'free', left, top: MARGIN }, { side: 'free', left, top: lowest });
  /** @type {(place: Place) => number} */
  const cost = (place) => hiddenCost(place, size, state, board) + 1000 * outside(place, size, stage);
  const best = options.reduce((a, b) => (cost(b) < cost(a) ? b : a));
  if (cost(best) >= VITAL) {
    const hides = (/** @type {Place} */ place) => Number(cell !== null && covers(cell, place, size, board)) * VITAL;
    return freest((place) => hiddenCost(place, size, state, board) + hides(place), size, stage);
  }
  const tip = clamp(centre - best.left, 22, size.width - 22);
  return { left: best.left, top: clamp(best.top, MARGIN, lowest), side: cell ? best.side : 'free', tip };
}

/**
 * Return where a bubble about the marks hides fewest of the cells that marks can reach; it points at nothing.
 * @param {Cell} cell of the watched chef
 * @param {StartedState} state
 * @param {BoardBox} board
 * @param {Size} size of the bubble
 * @param {Size} stage
 * @returns {Place & { tip: number }}
 */
export function placeBesideMarks(cell, state, board, size, stage) {
  const { grid } = state.game;
  /** @type {(place: Place) => number} */
  const cost = (place) => {
    let sum = hiddenCost(place, size, state, board);
    grid.forEach((row, y) =>
      [...row].forEach((_, x) => {
        const far = distance([x, y], cell);
        const isStraight = x === cell[0] || y === cell[1];
        if (far <= MARKS_REACH && covers([x, y], place, size, board)) sum += isStraight ? 20 : 4;
      }),
    );
    return sum;
  };
  return freest(cost, size, stage);
}

/**
 * Return the place anywhere on the stage that costs least; a bubble there points at nothing.
 * @param {(place: Place) => number} cost
 * @param {Size} size of the bubble
 * @param {Size} stage
 * @returns {Place & { tip: number }}
 */
function freest(cost, size, stage) {
  /** @type {Place[]} */
  const places = [];
  for (let left = MARGIN; left <= stage.width - size.width - MARGIN; left += GAP) {
    for (let top = MARGIN; top <= stage.height - size.height - MARGIN; top += GAP) {
      places.push({ side: 'free', left, top });
    }
  }
  /** @type {Place} */
  const corner = { side: 'free', left: MARGIN, top: MARGIN };
  return { ...places.reduce((a, b) => (cost(b) < cost(a) ? b : a), corner), tip: 0 };
}

/**
 * Return which text explains a lesson: marks on demand and intentions have their own.
 * @param {string} key
 * @param {State} state
 */
function textOf(key, { game }) {
  if (key !== 'marks' || !game) return 'text';
  const when = game.show === 'always' ? 'text' : game.show;
  return ['intention', 'both'].includes(game.display) ? `${game.display}_${when}` : when;
}

/** @type {(value: number, low: number, high: number) => number} */
function clamp(value, low, high) {
  return Math.max(low, Math.min(high, value));
}

/** @type {(place: Place, size: Size, stage: Size) => number} */
function outside({ top }, { height }, stage) {
  return Number(top < 0 || top + height > stage.height);
}

/**
 * Return the cost of what the bubble hides: a floor cell costs 1, a station 2, the other chef 4, the own chef and
 * pots so much that they are hidden only where all places hide one.
 * @type {(place: Place, size: Size, state: StartedState, board: BoardBox) => number}
 */
function hiddenCost(place, size, state, board) {
  const { grid } = state.game;
  let cost = 0;
  grid.forEach((row, y) =>
    [...row].forEach((tile, x) => {
      if (covers([x, y], place, size, board))
        cost += isFloor(grid, x, y) ? 1 : tile === 'X' ? 0 : tile === 'P' ? VITAL : 2;
    }),
  );
  state.current.players.forEach(([x, y], seat) => {
    if (covers([x, y], place, size, board)) cost += seat === state.game.seat ? VITAL : 4;
  });
  return cost;
}

/** @type {(cell: readonly number[], place: Place, size: Size, board: BoardBox) => boolean} */
function covers([x, y], { left, top }, size, board) {
  const cellLeft = board.left + x * board.cell;
  const cellTop = board.top + y * board.cell;
  const overlapsX = cellLeft < left + size.width && cellLeft + board.cell > left;
  return overlapsX && cellTop < top + size.height && cellTop + board.cell > top;
}

export class TutorialCoach {
  /**
   * @param {HTMLElement} stage
   * @param {HTMLElement} bubble
   * @param {HTMLElement} panel has the list of lessons
   * @param {string[]} keys of the lessons, where the server told them
   * @param {Catalogue} text
   * @param {() => Record<string, string | Node>} keyCaps gives the elements for {walk}, {use} and {marks}
   */
  constructor(stage, bubble, panel, keys, text, keyCaps) {
    this.stage = stage;
    this.bubble = bubble;
    this.list = find('ol', HTMLElement, panel);
    this.explanations = [bubble, panel].map((part) => find('.how', HTMLElement, part));
    this.title = find('.t', HTMLElement, bubble);
    this.keys = keys;
    this.text = text;
    this.keyCaps = keyCaps;
    this.shown = '';
    this.placed = '';
  }

  /**
   * Show the lesson; return the cell to highlight.
   * @param {State} state
   * @param {BoardBox | null} board
   */
  show(state, board) {
    const { lesson } = state;
    const playing = ['playing', 'countdown'].includes(state.phase) && state.link === 'open';
    this.bubble.hidden = !lesson || !playing;
    if (!lesson) return null;
    this.#write(lesson, state);
    if (!playing || !board || !isStarted(state)) return null;
    const cell = lesson.done ? null : target(lesson.key, state);
    const pointsAt = lesson.key === 'marks' ? '' : cell; // the watched chef moves, and the bubble does not follow it
    const place = `${lesson.index}:${lesson.done}:${pointsAt}:${board.cell}:${board.left}`;
    if (place !== this.placed) this.#move(cell, state, board);
    this.placed = place;
    return lesson.key === 'walk' ? null : cell;
  }

  /** Place the bubble again: the stage has another size. */
  moved() {
    this.placed = '';
  }

  /** Update the texts at the next opportunity, because they name other keys. */
  rewrite() {
    this.shown = '';
  }

  /**
   * @param {Wire.Lesson} lesson
   * @param {State} state
   */
  #write(lesson, state) {
    const same = `${lesson.key}:${lesson.index}:${lesson.done}:${state.game?.show}`;
    if (same === this.shown) return;
    this.shown = same;
    this.placed = '';
    const key = lesson.done ? 'done' : lesson.key;
    this.title.textContent = this.text(`lesson.${key}.title`);
    for (const place of this.explanations) {
      place.replaceChildren(...this.text.nodes(`lesson.${key}.${textOf(key, state)}`, this.keyCaps()));
    }
    const keys = (this.keys.length ? this.keys : state.lessons).slice(0, lesson.steps);
    this.list.replaceChildren(...keys.map((each, index) => this.#item(each, index, lesson)));
  }

  /**
   * @param {string} key
   * @param {number} index
   * @param {Wire.Lesson} lesson
   */
  #item(key, index, lesson) {
    const item = document.createElement('li');
    item.textContent = this.text(`lesson.${key}.todo`);
    item.dataset.number = String(index + 1);
    item.className = lesson.done || index < lesson.index ? 'done' : index === lesson.index ? 'now' : '';
    if (item.className === 'now') item.setAttribute('aria-current', 'step');
    return item;
  }

  /**
   * @param {Cell | null} cell
   * @param {StartedState} state
   * @param {BoardBox} board
   */
  #move(cell, state, board) {
    const size = { width: this.bubble.offsetWidth, height: this.bubble.offsetHeight };
    const stage = { width: this.stage.clientWidth, height: this.stage.clientHeight };
    const isOnMarks = state.lesson?.key === 'marks' && cell;
    const placed = isOnMarks
      ? placeBesideMarks(cell, state, board, size, stage)
      : bubblePlace(cell, state, board, size, stage);
    const { left, top, side, tip } = placed;
    this.bubble.style.left = `${left}px`;
    this.bubble.style.top = `${top}px`;
    this.bubble.style.setProperty('--tip', `${tip}px`);
    this.bubble.dataset.side = side;
  }
}
