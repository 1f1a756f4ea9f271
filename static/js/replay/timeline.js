// The time lines under the kitchen: the whole episode, and the timesteps around the one shown.

import { make } from '../admin/elements.js';
import { SIGNS, actionAt, predictedAt, wasDropped } from './details.js';

/** @typedef {Researcher.EpisodeRecord} EpisodeRecord */
/** @typedef {{ text: string | number, cut?: boolean, miss?: boolean, key?: boolean, late?: boolean }} Cell */
/** @typedef {{ className: string, words: string, note: string, cell: (at: number) => Cell }} Lane */

const SVG = 'http://www.w3.org/2000/svg';
const WIDTH = 40; // timesteps
const LATE_MS = 50;
const AWAY = ['hidden', 'blur', 'lost', 'other_tab'];

/**
 * @param {string} name
 * @param {Record<string, string | number>} attributes
 * @param {string} title
 */
function shape(name, attributes, title = '') {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  if (title) element.append(Object.assign(document.createElementNS(SVG, 'title'), { textContent: title }));
  return element;
}

/** @param {number | null | undefined} action */
function signOf(action) {
  return action === null || action === undefined ? '' : (SIGNS[action] ?? '');
}

/**
 * Return the timesteps at which something happened, in order: deliveries, pauses, late partners.
 * @param {EpisodeRecord} record
 */
export function eventsOf({ rows, pauses }) {
  const at = new Set(pauses.map((pause) => pause.t));
  for (const row of rows) if (row.late || row.rewards[0] + row.rewards[1] > 0) at.add(row.t);
  return [...at].sort((a, b) => a - b);
}

export class TimeLine {
  /**
   * @param {HTMLElement} axis the whole episode
   * @param {HTMLElement} frame the timesteps around the one shown
   * @param {(t: number) => void} go
   */
  constructor(axis, frame, go) {
    this.axis = axis;
    this.frame = frame;
    /** @type {EpisodeRecord | null} */
    this.record = null;
    this.drawn = -1;
    this.length = 1;
    /** @type {Element | null} marks the timestep shown */
    this.head = null;
    frame.addEventListener('click', ({ target }) => {
      const cell = target instanceof Element ? target.closest('[data-t]') : null;
      if (cell instanceof HTMLElement) go(Number(cell.dataset.t));
    });
  }

  /** @param {number} t */
  eventBefore(t) {
    const before = this.record ? eventsOf(this.record).filter((at) => at < t) : [];
    return before[before.length - 1] ?? 0;
  }

  /** @param {number} t */
  eventAfter(t) {
    if (!this.record) return 0;
    return eventsOf(this.record).find((at) => at > t) ?? this.record.rows.length - 1;
  }

  /**
   * @param {EpisodeRecord} record
   * @param {number} t
   */
  show(record, t) {
    const fresh = record !== this.record || record.rows.length !== this.drawn;
    this.record = record;
    if (fresh) this.#drawAxis(record);
    this.drawn = record.rows.length;
    this.head?.setAttribute('x', `${(100 * t) / this.length}%`);
    this.#drawFrame(record, t);
  }

  /** @param {EpisodeRecord} record */
  #drawAxis(record) {
    const last = record.rows.length - 1;
    const length = Math.max(1, record.game.horizon || last);
    this.length = length;
    /** @param {number} t */
    const x = (t) => `${(100 * t) / length}%`;
    const svg = shape('svg', { role: 'img', 'aria-label': `Events of ${last} timesteps` });
    svg.append(shape('rect', { class: 'rest', x: 0, y: 6, width: '100%', height: 20, rx: 3 }));
    svg.append(shape('rect', { class: 'played', x: 0, y: 6, width: x(last), height: 20, rx: 3 }));
    svg.append(...record.rows.flatMap((row) => rowShapes(row, x(row.t))));
    svg.append(...record.pauses.map((pause) => pauseShape(pause, record.game, x(pause.t))));
    this.head = shape('rect', { class: 'head', x: 0, y: 0, width: 3, height: 34 });
    svg.append(this.head);
    this.axis.replaceChildren(svg);
  }

  /**
   * @param {EpisodeRecord} record
   * @param {number} t
   */
  #drawFrame(record, t) {
    const last = record.rows.length - 1;
    const first = Math.max(0, Math.min(t - WIDTH / 2, last - WIDTH + 1));
    const shown = Array.from({ length: Math.min(WIDTH, last - first + 1) }, (_, place) => first + place);
    const rows = lanes(record).map(({ className, words, note, cell }) => {
      const head = make('th', { scope: 'row' }, make('b', { text: words }), ` ${note}`);
      return make('tr', { className }, head, ...shown.map((at) => tableCell(cell(at), at, t)));
    });
    this.frame.replaceChildren(make('table', {}, make('tbody', {}, ...rows)));
    this.#scrollToShown();
  }

  /** On narrow screens the frame scrolls: the timestep shown is in the middle of the space next to the labels. */
  #scrollToShown() {
    const now = this.frame.querySelector('td.now');
    const head = this.frame.querySelector('th');
    if (!(now instanceof HTMLElement) || !(head instanceof HTMLElement)) return;
    const free = this.frame.clientWidth - head.offsetWidth;
    this.frame.scrollLeft = now.offsetLeft + now.offsetWidth / 2 - head.offsetWidth - free / 2;
  }
}

/**
 * @param {Researcher.Row} row
 * @param {string} x
 */
function rowShapes(row, x) {
  const shapes = [];
  if (row.rewards[0] + row.rewards[1] > 0) {
    shapes.push(shape('circle', { class: 'delivery', cx: x, cy: 16, r: 5 }, `delivery at t ${row.t}`));
  }
  if (row.late) {
    const title = `the partner was late at t ${row.t}`;
    shapes.push(shape('rect', { class: 'away', x, y: 22, width: 2, height: 6 }, title));
  }
  return shapes;
}

/**
 * @param {EpisodeRecord['pauses'][number]} pause
 * @param {EpisodeRecord['game']} game
 * @param {string} x
 */
function pauseShape(pause, game, x) {
  const { t, reason, duration_ms: durationMs } = pause;
  const length = durationMs === null ? '' : `, ${(durationMs / 1000).toFixed(1)} s`;
  const className = AWAY.includes(reason) ? 'away' : 'stop';
  return shape(
    'rect',
    { class: className, x, y: 4, width: 4, height: 24 },
    `${causeOf(pause, game)}${length} at t ${t}`,
  );
}

/**
 * Return why a game was paused, and whose absence it was; the colours are those of the board.
 * @param {EpisodeRecord['pauses'][number]} pause
 * @param {EpisodeRecord['game']} game
 */
function causeOf({ reason, seat }, game) {
  if (seat === null || !AWAY.includes(reason)) return reason;
  return `absence of the ${seat === Math.max(0, game.seat) ? 'blue' : 'green'} chef (${reason})`;
}

/**
 * @param {EpisodeRecord} record
 * @returns {Lane[]}
 */
function lanes(record) {
  if (record.game.seat < 0)
    return [timeLane(record), ...['Blue', 'Green'].map((who, seat) => didLane(record, who, seat))];
  return [timeLane(record), ...watchedLanes(record), ...inputLanes(record), ...lagLanes(record)];
}

/**
 * @param {EpisodeRecord} record
 * @returns {Lane}
 */
function timeLane({ pauses }) {
  /** @param {number} at */
  const cell = (at) => ({ text: at % 5 ? '' : at, cut: pauses.some((pause) => pause.t === at) });
  return { className: 't', words: 'Timestep', note: '', cell };
}

/**
 * Return a chef's actions in a game from a file, which has no other data.
 * @param {EpisodeRecord} record
 * @param {string} words
 * @param {number} seat
 * @returns {Lane}
 */
function didLane({ rows }, words, seat) {
  return { className: 'did', words, note: 'did', cell: (at) => ({ text: signOf(rows[at + 1]?.actions?.[seat]) }) };
}

/**
 * Return what the watched chef did, and the predictions of it.
 * @param {EpisodeRecord} record
 * @returns {Lane[]}
 */
function watchedLanes(record) {
  const { seat, watched_seat: watched, people = 1 } = record.game;
  const partner = people > 1 ? 'Partner' : 'AI';
  const words = watched === seat ? 'Person' : partner;
  /** @type {Lane} */
  const did = { className: 'did', words, note: 'did', cell: (at) => ({ text: signOf(actionAt(record, at)) }) };
  /** @type {Lane[]} */
  const predicted = [0, 1, 2].map((step) => ({
    className: 'predicted',
    words: `step ${step + 1}`,
    note: step ? `predicted at t − ${step}` : 'predicted at t',
    cell: (at) => {
      const action = at < step ? null : predictedAt(record, at - step, step);
      const taken = actionAt(record, at);
      return { text: signOf(action), miss: action !== null && taken !== null && action !== taken };
    },
  }));
  return [did, ...predicted];
}

/**
 * Return what the person did and sent.
 * @param {EpisodeRecord} record
 * @returns {Lane[]}
 */
function inputLanes(record) {
  const { seat } = record.game;
  /** @type {Lane[]} */
  const found = [];
  if (seat >= 0) {
    /** @param {number} at */
    const cell = (at) => {
      const next = record.rows[at + 1];
      return { text: signOf(next?.actions?.[seat]), key: next?.keys.some(([who]) => who === seat) };
    };
    found.push({ className: 'keys', words: 'Person', note: 'did; shaded: a key', cell });
  }
  if (record.inputs.length) {
    /** @param {number} at */
    const cell = (at) => {
      const here = record.inputs.filter((input) => input.t === at);
      return { text: here.length || '', miss: here.some(wasDropped) };
    };
    found.push({ className: 'keys', words: 'Inputs', note: 'boxed: one was not done', cell });
  }
  return found;
}

/**
 * @param {EpisodeRecord} record
 * @returns {Lane[]}
 */
function lagLanes({ rows, game }) {
  /** @param {number} at */
  const tick = (at) => ({ text: Math.round(rows[at].late_ms), late: rows[at].late || rows[at].late_ms > LATE_MS });
  /** @param {number} at */
  const models = (at) => ({ text: Math.round(rows[at].models_ms), late: rows[at].models_ms > game.deadline_ms });
  return [
    { className: 'lag', words: 'Lag', note: 'tick late, ms', cell: tick },
    { className: 'lag', words: 'Models', note: 'ms', cell: models },
  ];
}

/**
 * @param {Cell} cell
 * @param {number} at
 * @param {number} t the timestep shown
 */
function tableCell({ text, ...flags }, at, t) {
  const names = Object.entries(flags).flatMap(([name, isSet]) => (isSet ? [name] : []));
  if (at === t) names.push('now');
  return make('td', { text, className: names.join(' '), 'data-t': at });
}

/** Return the timestep of an address such as `#t=123`; null if it has none. */
export function timestepInAddress() {
  const found = /^#t=(\d+)$/.exec(location.hash);
  return found ? Number(found[1]) : null;
}
