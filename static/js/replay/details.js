// Shows details of one timestep (predicted probabilities, inputs) and of the game (accuracy, verification).

/** @import { Catalogue } from '../browser/texts.js' */

import { make, percent } from '../admin/elements.js';
import { intentionOf, intentionWords } from '../board/intention.js';
import { tickOf } from '../board/still-board.js';

export const SIGNS = ['↑', '↓', '→', '←', '○', '◆'];
export const NAMES = ['up', 'down', 'right', 'left', 'wait', 'use'];
const STEPS = [0, 1, 2];
const SVG = 'http://www.w3.org/2000/svg';

/**
 * Return a stored timestep as the message that the participant's page got.
 * @param {Researcher.Row} row
 * @returns {Wire.Tick}
 */
export function frameOf({ state, displayed, displayed_intention: shown, actions, late }) {
  const intention = shown ? { intention: shown } : {};
  return tickOf({ state, prediction: displayed, actions: actions ?? [4, 4], late, ...intention });
}

/**
 * Return what the watched chef did in timestep t; null while that is unknown.
 * @param {Researcher.EpisodeRecord} record
 * @param {number} t
 */
export function actionAt(record, t) {
  return record.rows[t + 1]?.actions?.[record.game.watched_seat] ?? null;
}

/**
 * Return the likeliest action of a step of the prediction on state t; null if nothing was predicted.
 * @param {Researcher.EpisodeRecord} record
 * @param {number} t
 * @param {number} step
 */
export function predictedAt(record, t, step) {
  const probabilities = record.rows[t]?.prediction?.[step];
  return probabilities ? probabilities.indexOf(Math.max(...probabilities)) : null;
}

/**
 * @param {HTMLElement} table
 * @param {HTMLElement} place where the timestep is written
 * @param {Researcher.EpisodeRecord} record
 * @param {number} t
 */
export function showPrediction(table, place, record, t) {
  place.textContent = String(t);
  const heads = STEPS.map((step) => {
    return make('th', { scope: 'col' }, make('b', { text: `step ${step + 1}` }), `t ${t + step}`);
  });
  const rows = NAMES.map((_, action) => predictionRow(record, t, action));
  const head = make('tr', {}, make('td'), ...heads);
  const { asked, misleading } = record.rows[t];
  const drawn = misleading ? 'The marks drawn are a wrong future, not these steps.' : '';
  const note = asked === false ? 'Not shown: the participant did not ask for the marks.' : drawn;
  const caption = make('caption', { className: 'soft', text: note });
  table.replaceChildren(...(note ? [caption] : []), make('thead', {}, head), make('tbody', {}, ...rows));
}

/**
 * Show the likeliest intentions on state t, in words; nothing without any.
 * @param {HTMLElement} list
 * @param {Researcher.EpisodeRecord} record
 * @param {number} t
 * @param {Catalogue} text
 */
export function showIntentions(list, record, t, text) {
  const { grid, watched_seat: watched, tick_ms: tickMs } = record.game;
  const { intentions, state } = record.rows[t];
  const [chef, other] = [state.players[watched], state.players[1 - watched]];
  const items = intentions.map(({ kind, x, y, steps, probability }) => {
    const intention = intentionOf([kind, x, y, 100], chef, other, grid);
    const words = intention ? intentionWords(intention, grid, text) : 'nothing soon';
    const when = intention ? ` in ${((steps * tickMs) / 1000).toFixed(1)} s` : '';
    return make('li', {}, `${words}${when}: `, make('b', { text: `${percent(probability)} %` }));
  });
  list.hidden = !items.length;
  list.replaceChildren(...items);
}

/**
 * @param {Researcher.EpisodeRecord} record
 * @param {number} t
 * @param {number} action
 */
function predictionRow(record, t, action) {
  const sign = make('span', { text: SIGNS[action], 'aria-hidden': 'true' });
  const cells = STEPS.map((step) => {
    const isLikeliest = predictedAt(record, t, step) === action;
    const wasTaken = actionAt(record, t + step) === action;
    const share = record.rows[t].prediction[step]?.[action];
    return make('td', {}, probabilityBar(share, isLikeliest, wasTaken));
  });
  return make('tr', {}, make('th', { scope: 'row' }, make('span', {}, sign, NAMES[action])), ...cells);
}

/**
 * @param {number | undefined} share
 * @param {boolean} isLikeliest
 * @param {boolean} wasTaken
 */
function probabilityBar(share, isLikeliest, wasTaken) {
  const bar = document.createElementNS(SVG, 'svg');
  const fill = document.createElementNS(SVG, 'rect');
  bar.setAttribute('aria-hidden', 'true');
  fill.setAttribute('height', '12');
  fill.setAttribute('width', `${100 * (share ?? 0)}%`);
  bar.append(fill);
  const note = wasTaken ? [make('span', { className: 'sr', text: ', done' })] : [];
  const value = make('span', { text: share === undefined ? '–' : Math.round(100 * share) });
  const track = make('span', { className: `tr${wasTaken ? ' was' : ''}` }, bar);
  return make('span', { className: `pb${isLikeliest ? ' lead' : ''}` }, track, value, ...note);
}

/** @type {Record<string, string>} */
const OUTCOMES = {
  applied: 'done',
  released: 'keys released',
  replaced: 'not done: a later key replaced it',
  forgotten: 'not done: the game was paused',
  stood_still: 'not done: the game was not running',
  unchanged: 'nothing new',
  repeated: 'not done: a repeat',
  ended: 'not done: the game was over',
  marks: 'done',
};

/**
 * Whether an input was sent without effect.
 * @param {Researcher.Input} input
 */
export function wasDropped({ outcome }) {
  return OUTCOMES[outcome]?.startsWith('not done') ?? false;
}

/**
 * Show the inputs of timestep t, used or not: number, keys and outcome.
 * @param {HTMLElement} list
 * @param {HTMLElement} place where the timestep is written
 * @param {Researcher.EpisodeRecord} record
 * @param {number} t
 */
export function showInputs(list, place, record, t) {
  place.textContent = String(t);
  const items = record.inputs.filter((input) => input.t === t).map(inputItem);
  list.replaceChildren(...(items.length ? items : [make('li', { className: 'soft', text: 'None.' })]));
}

/** @param {Researcher.Input} input */
function inputItem(input) {
  const keys = [];
  if (input.tap !== null) keys.push(`${NAMES[input.tap]} pressed`);
  if (input.held !== null) keys.push(`${NAMES[input.held]} held`);
  if (input.marks !== null) keys.push(`marks key ${input.marks ? 'down' : 'up'}`);
  const className = wasDropped(input) ? 'flag warn' : '';
  const outcome = make('span', { className, text: OUTCOMES[input.outcome] ?? input.outcome });
  const number = make('b', { text: `#${input.seq}` });
  return make('li', { 'data-outcome': input.outcome }, number, ` ${keys.join(', ') || 'no key held'}: `, outcome);
}

/**
 * @param {HTMLElement} list
 * @param {Researcher.EpisodeRecord['accuracy']} steps
 * @param {Researcher.EpisodeRecord['intention_accuracy']} intention kind and station of the likeliest one
 */
export function showAccuracy(list, steps, intention) {
  const named = steps.map((step, index) => ({ ...step, name: `step ${index + 1}` }));
  if (intention) named.push({ ...intention, name: 'intention' });
  const cells = named.flatMap(({ name, share, low, high, n }) => [
    make('dt', { text: `Right, ${name} (n = ${n})` }),
    make('dd', { text: n ? `${percent(share)} % (${percent(low)}–${percent(high)})` : '–' }),
  ]);
  list.replaceChildren(...cells);
}

/**
 * Show whether the re-simulated states are equal to the stored ones.
 * @param {HTMLElement} place
 * @param {Researcher.EpisodeRecord} record
 */
export function showVerification(place, { checked }) {
  const { equal, states, difference } = checked;
  const badge = make('span', { className: `badge ${equal ? 'good' : 'bad'}`, text: equal ? 'equal' : 'different' });
  place.replaceChildren(
    badge,
    ` ${equal ? `${states} of ${states} states are equal to the stored hashes` : difference}`,
  );
}
