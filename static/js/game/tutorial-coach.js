// The tutorial's coach: the list of what to do, the bubble that says how, and the place in the kitchen that it points at.

import { COOK_TIME, SOUP, cellsOf, isFloor } from '../board/kitchen.js';

const DISH = 2;

/** The cell [x, y] a lesson points at now; null where it points at nothing. A function of the lesson and what is seen. */
export function target(key, state) {
  const { grid, seat, watched_seat: watched } = state.game;
  const { players, pots } = state.current;
  const own = players[seat];
  const nearest = (cells) => [...cells].sort((a, b) => distance(a, own) - distance(b, own))[0] ?? null;
  const full = pots.filter(([, , , tick]) => tick >= 0);
  const ready = nearest(full.filter(([, , , tick]) => tick >= COOK_TIME));
  const filling = nearest(pots.filter(([, , onions, tick]) => tick < 0 && onions > 0)) ?? nearest(cellsOf(grid, 'P'));
  const places = {
    fetch: () => nearest(cellsOf(grid, 'O')),
    fill: () => (own[3] === 0 ? nearest(cellsOf(grid, 'O')) : filling),
    wait: () => nearest(full) ?? filling,
    plate: () => (own[3] === DISH ? ready ?? nearest(full) : nearest(cellsOf(grid, 'D'))),
    deliver: () => (own[3] === SOUP ? nearest(cellsOf(grid, 'S')) : null),
    marks: () => players[watched],
  };
  const place = places[key]?.();
  return place ? [place[0], place[1]] : null;
}

function distance([x, y], [otherX, otherY]) {
  return Math.abs(x - otherX) + Math.abs(y - otherY);
}

/** Where a bubble of width x height hides least: {left, top, side, tip}. `board`: {left, top, cell} in the stage's pixels. */
export function bubblePlace(cell, state, board, size, stage) {
  const centre = cell ? board.left + (cell[0] + 0.5) * board.cell : stage.width / 2;
  const left = clamp(centre - size.width / 2, 8, stage.width - size.width - 8);
  const gap = 14;
  const options = [
    { side: 'below', left, top: board.top + ((cell?.[1] ?? -1) + 1) * board.cell + gap },
    { side: 'above', left, top: board.top + (cell?.[1] ?? state.game.grid.length) * board.cell - size.height - gap },
  ];
  if (!cell) options.push({ side: 'free', left, top: 8 }, { side: 'free', left, top: stage.height - size.height - 8 });
  const scored = options.map((option) => ({ ...option, cost: hidden(option, size, state, board) + 1000 * outside(option, size, stage) }));
  const best = scored.reduce((a, b) => (b.cost < a.cost ? b : a));
  const top = clamp(best.top, 8, stage.height - size.height - 8);
  return { left: best.left, top, side: cell ? best.side : 'free', tip: clamp(centre - best.left, 22, size.width - 22) };
}

function clamp(value, low, high) {
  return Math.max(low, Math.min(high, value));
}

function outside({ top }, { height }, stage) {
  return Number(top < 0 || top + height > stage.height);
}

/** How much of use lies below the bubble: floor 1, stations 2, chefs 4. */
function hidden({ left, top }, size, state, board) {
  let cost = 0;
  const covers = (x, y) => {
    const cellLeft = board.left + x * board.cell, cellTop = board.top + y * board.cell;
    return cellLeft < left + size.width && cellLeft + board.cell > left && cellTop < top + size.height && cellTop + board.cell > top;
  };
  state.game.grid.forEach((row, y) => [...row].forEach((tile, x) => {
    if (covers(x, y)) cost += isFloor(state.game.grid, x, y) ? 1 : tile === 'X' ? 0 : 2;
  }));
  for (const [x, y] of state.current.players) if (covers(x, y)) cost += 4;
  return cost;
}

export class Coach {
  /** `keyCaps()` gives the elements for {walk} and {use} in the texts. */
  constructor(stage, bubble, panel, keys, text, keyCaps) {
    Object.assign(this, { stage, bubble, list: panel.querySelector('ol'), how: panel.querySelector('.how'), keys, text, keyCaps, shown: '', placed: '' });
  }

  /** Shows the lesson; returns the cell to point at. `board`: {left, top, cell} in the stage's pixels. */
  show(state, board) {
    const { lesson } = state;
    const playing = ['playing', 'countdown'].includes(state.phase) && state.link === 'open';
    this.bubble.hidden = !lesson || !playing;
    if (!lesson) return null;
    this.#write(lesson, state);
    if (!playing || !board) return null;
    const cell = lesson.done ? null : target(lesson.key, state);
    const place = `${lesson.index}:${lesson.done}:${lesson.key === 'marks' ? '' : cell}:${board.cell}:${board.left}`;
    if (place !== this.placed) this.#move(cell, state, board);
    this.placed = place;
    return lesson.key === 'walk' ? null : cell;
  }

  /** Puts the bubble where it belongs again: the stage has another size. */
  moved() {
    this.placed = '';
  }

  /** Writes the words again at the next chance: other keys are meant. */
  rewrite() {
    this.shown = '';
  }

  #write(lesson, state) {
    const same = `${lesson.key}:${lesson.index}:${lesson.done}`;
    if (same === this.shown) return;
    this.shown = same;
    this.placed = '';
    const key = lesson.done ? 'done' : lesson.key;
    this.bubble.querySelector('.t').textContent = this.text(`lesson.${key}.title`);
    for (const how of [this.bubble.querySelector('.how'), this.how]) how.replaceChildren(...this.text.nodes(`lesson.${key}.text`, this.keyCaps()));
    const keys = (this.keys.length ? this.keys : state.lessons).slice(0, lesson.steps);
    this.list.replaceChildren(...keys.map((each, index) => {
      const item = document.createElement('li');
      item.textContent = this.text(`lesson.${each}.todo`);
      item.dataset.number = index + 1;
      item.className = lesson.done || index < lesson.index ? 'done' : index === lesson.index ? 'now' : '';
      if (item.className === 'now') item.setAttribute('aria-current', 'step');
      return item;
    }));
  }

  #move(cell, state, board) {
    const size = { width: this.bubble.offsetWidth, height: this.bubble.offsetHeight };
    const stage = { width: this.stage.clientWidth, height: this.stage.clientHeight };
    const { left, top, side, tip } = bubblePlace(cell, state, board, size, stage);
    this.bubble.style.left = `${left}px`;
    this.bubble.style.top = `${top}px`;
    this.bubble.style.setProperty('--tip', `${tip}px`);
    this.bubble.dataset.side = side;
  }
}
