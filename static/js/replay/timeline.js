// The time lines under the kitchen: the whole episode, and the timesteps around the one shown with what was said and done.

import { make } from '../admin/admin-page.js';
import { SIGNS, done, said, wasDropped } from './details.js';

const SVG = 'http://www.w3.org/2000/svg';
const WIDE = 40;
const AWAY = ['hidden', 'blur', 'lost', 'other_tab'];

const shape = (name, attributes, title) => {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (title) element.append(Object.assign(document.createElementNS(SVG, 'title'), { textContent: title }));
  return element;
};

/** Timesteps at which something happened, in order: deliveries, pauses, late partners. */
export function eventsOf({ rows, pauses }) {
  const at = new Set(pauses.map((pause) => pause.t));
  for (const row of rows) if (row.late || row.rewards[0] + row.rewards[1] > 0) at.add(row.t);
  return [...at].sort((a, b) => a - b);
}

export class TimeLine {
  constructor(axis, frame, go) {
    Object.assign(this, { axis, frame, go, record: null, drawn: -1, head: null });
    frame.addEventListener('click', ({ target }) => { const cell = target.closest('[data-t]'); if (cell) go(Number(cell.dataset.t)); });
  }

  eventBefore(t) {
    return eventsOf(this.record).filter((at) => at < t).at(-1) ?? 0;
  }

  eventAfter(t) {
    return eventsOf(this.record).find((at) => at > t) ?? this.record.rows.length - 1;
  }

  show(record, t) {
    const fresh = record !== this.record || record.rows.length !== this.drawn;
    this.record = record;
    if (fresh) this.#axis(record);
    this.drawn = record.rows.length;
    this.head?.setAttribute('x', `${100 * t / this.length}%`);
    this.#frame(record, t);
  }

  #axis(record) {
    const length = this.length = Math.max(1, record.game.horizon || record.rows.length - 1);
    const svg = shape('svg', { role: 'img', 'aria-label': `Events of ${record.rows.length - 1} timesteps` });
    const x = (t) => `${100 * t / length}%`;
    svg.append(shape('rect', { class: 'rest', x: 0, y: 6, width: '100%', height: 20, rx: 3 }), shape('rect', { class: 'played', x: 0, y: 6, width: x(record.rows.length - 1), height: 20, rx: 3 }));
    for (const row of record.rows) {
      if (row.rewards[0] + row.rewards[1] > 0) svg.append(shape('circle', { class: 'delivery', cx: x(row.t), cy: 16, r: 5 }, `delivery at t ${row.t}`));
      if (row.late) svg.append(shape('rect', { class: 'away', x: x(row.t), y: 22, width: 2, height: 6 }, `the partner was late at t ${row.t}`));
    }
    for (const pause of record.pauses) {
      const words = `${pause.reason}${pause.duration_ms === null ? '' : `, ${(pause.duration_ms / 1000).toFixed(1)} s`} at t ${pause.t}`;
      svg.append(shape('rect', { class: AWAY.includes(pause.reason) ? 'away' : 'stop', x: x(pause.t), y: 4, width: 4, height: 24 }, words));
    }
    this.head = shape('rect', { class: 'head', x: 0, y: 0, width: 3, height: 34 });
    svg.append(this.head);
    this.axis.replaceChildren(svg);
  }

  #frame(record, t) {
    const last = record.rows.length - 1;
    const first = Math.max(0, Math.min(t - WIDE / 2, last - WIDE + 1));
    const shown = Array.from({ length: Math.min(WIDE, last - first + 1) }, (_, place) => first + place);
    const lane = (name, words, note, cell) => make('tr', { className: name }, make('th', { scope: 'row' }, make('b', { text: words }), ` ${note}`), ...shown.map((at) => this.#cell(cell(at), at, t)));
    const { seat, watched_seat: watched } = record.game;
    const rows = [
      lane('t', 'Timestep', '', (at) => ({ text: at % 5 ? '' : at, cut: record.pauses.some((pause) => pause.t === at) })),
      lane('did', watched === seat ? 'Person' : 'AI', 'did', (at) => ({ text: SIGNS[done(record, at)] ?? '' })),
      ...[0, 1, 2].map((step) => lane('foretold', `step ${step + 1}`, step ? `said at t − ${step}` : 'said at t', (at) => {
        const action = at - step < 0 ? null : said(record, at - step, step);
        const what = done(record, at);
        return { text: action === null ? '' : SIGNS[action], miss: action !== null && what !== null && action !== what };
      })),
    ];
    if (seat >= 0) {
      rows.push(lane('keys', 'Person', 'did; shaded: a key', (at) => {
        const next = record.rows[at + 1];
        return { text: SIGNS[next?.actions?.[seat]] ?? '', key: next?.keys.some(([who]) => who === seat) };
      }));
    }
    if (record.inputs.length) {
      rows.push(lane('keys', 'Inputs', 'boxed: one was not done', (at) => {
        const here = record.inputs.filter((input) => input.t === at);
        return { text: here.length || '', miss: here.some(wasDropped) };
      }));
    }
    rows.push(lane('lag', 'Lag', 'tick late, ms', (at) => ({ text: Math.round(record.rows[at].late_ms), late: record.rows[at].late || record.rows[at].late_ms > 50 })));
    rows.push(lane('lag', 'Models', 'ms', (at) => ({ text: Math.round(record.rows[at].models_ms), late: record.rows[at].models_ms > record.game.deadline_ms })));
    this.frame.replaceChildren(make('table', {}, make('tbody', {}, ...rows)));
  }

  #cell({ text, ...marks }, at, t) {
    const names = Object.keys(marks).filter((name) => marks[name]);
    if (at === t) names.push('now');
    return make('td', { text, className: names.join(' '), 'data-t': at });
  }
}
