// What is said beside the kitchen: probabilities of the next steps, how often they were right, whether the record is sound.

import { make, percent } from '../admin/admin-page.js';

export const SIGNS = ['↑', '↓', '→', '←', '○', '◆'];
export const NAMES = ['up', 'down', 'right', 'left', 'wait', 'use'];
const SVG = 'http://www.w3.org/2000/svg';

/** What the watched chef did in timestep t; null where it is not known (yet). */
export function done(record, t) {
  return record.rows[t + 1]?.actions?.[record.game.watched_seat] ?? null;
}

/** The likeliest action of a step of the prediction on state t; null: nothing was predicted. */
export function said(record, t, step) {
  const chances = record.rows[t]?.prediction?.[step];
  return chances ? chances.indexOf(Math.max(...chances)) : null;
}

export function showPrediction(table, place, record, t) {
  place.textContent = t;
  const { prediction } = record.rows[t];
  const head = make('tr', {}, make('td'), ...[0, 1, 2].map((step) => make('th', { scope: 'col' }, make('b', { text: `step ${step + 1}` }), `t ${t + step}`)));
  const rows = NAMES.map((name, action) => make('tr', {}, make('th', { scope: 'row' }, make('span', {}, make('span', { text: SIGNS[action], 'aria-hidden': 'true' }), name)),
    ...[0, 1, 2].map((step) => make('td', {}, chance(prediction[step]?.[action], said(record, t, step) === action, done(record, t + step) === action)))));
  table.replaceChildren(make('thead', {}, head), make('tbody', {}, ...rows));
}

function chance(share, lead, was) {
  const bar = document.createElementNS(SVG, 'svg');
  const fill = document.createElementNS(SVG, 'rect');
  bar.setAttribute('aria-hidden', 'true');
  fill.setAttribute('height', '12');
  fill.setAttribute('width', `${100 * (share ?? 0)}%`);
  bar.append(fill);
  return make('span', { className: `pb${lead ? ' lead' : ''}` }, make('span', { className: `tr${was ? ' was' : ''}` }, bar),
    make('span', { text: share === undefined ? '–' : Math.round(100 * share) }, ...(was ? [make('span', { className: 'sr', text: ', done' })] : [])));
}

const OUTCOMES = {
  applied: 'done', released: 'keys let go', replaced: 'not done: a later key took its place', forgotten: 'not done: the game was paused', stood_still: 'not done: the game stood still',
  unchanged: 'nothing new', repeated: 'not done: a repeat', ended: 'not done: the game was over',
};

/** Whether an input was sent without effect. */
export const wasDropped = ({ outcome }) => OUTCOMES[outcome]?.startsWith('not done') ?? false;

/** The inputs of timestep t, used or not: number, keys, what became of them. */
export function showInputs(list, place, record, t) {
  place.textContent = t;
  const here = record.inputs.filter((input) => input.t === t);
  list.replaceChildren(...(here.length ? here.map((input) => {
    const keys = [...(input.tap === null ? [] : [`${NAMES[input.tap]} pressed`]), ...(input.held === null ? [] : [`${NAMES[input.held]} held`])];
    return make('li', { 'data-outcome': input.outcome }, make('b', { text: `#${input.seq}` }), ` ${keys.join(', ') || 'no key held'}: `, make('span', { className: wasDropped(input) ? 'flag warn' : '', text: OUTCOMES[input.outcome] ?? input.outcome }));
  }) : [make('li', { className: 'soft', text: 'None.' })]));
}

export function showAccuracy(list, steps) {
  list.replaceChildren(...steps.flatMap(({ share, low, high, n }, step) => [
    make('dt', { text: `Right, step ${step + 1} (n = ${n})` }), make('dd', { text: n ? `${percent(share)} % (${percent(low)}–${percent(high)})` : '–' })]));
}

export function showChecked(place, { checked }) {
  const words = checked.equal ? `${checked.states} of ${checked.states} states are equal to the stored hashes` : checked.difference;
  place.replaceChildren(make('span', { className: `badge ${checked.equal ? 'good' : 'bad'}`, text: checked.equal ? 'equal' : 'different' }), ` ${words}`);
}
