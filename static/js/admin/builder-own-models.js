// Below the fields of an agent and its predictor: what was trained here for the draft's kitchens, each to be chosen.

import { findAll } from '../browser/dom.js';
import { make } from './elements.js';

/** @typedef {(string | number)[]} Path */
/** @typedef {Record<string, { agents: string[], predictors: string[] }>} OwnModels by kitchen */

const PLACE = 'ownModels';

/**
 * Return a place for the names that can stand in a field; null if no model is named there.
 * @param {Path} path
 */
export function placeForModels(path) {
  const kind = kindAt(path);
  if (!kind) return null;
  const place = make('div', { className: 'own-models', role: 'group', hidden: '' });
  place.setAttribute('aria-label', `${kind === 'agents' ? 'Agents' : 'Predictors'} that were trained here`);
  place.dataset[PLACE] = JSON.stringify(path);
  return place;
}

/**
 * Fill these places; the server lists them with every check.
 * @param {HTMLElement} form
 * @param {any} values of the draft
 * @param {OwnModels} own
 * @param {(path: Path, name: string) => void} choose
 */
export function showOwnModels(form, values, own, choose) {
  for (const place of findAll('[data-own-models]', HTMLElement, form)) {
    /** @type {Path} */
    const path = JSON.parse(place.dataset[PLACE] ?? '[]');
    const kitchens = kitchensOf(values, path);
    const names = namesFor(kindAt(path) || 'agents', kitchens, own);
    const chosen = path.reduce((value, key) => value?.[key], values);
    const state = JSON.stringify([[...names], chosen]);
    if (place.dataset.state === state) continue; // a rebuilt button would lose the focus
    place.dataset.state = state;
    place.hidden = names.size === 0;
    const buttons = [...names].map(([name, where]) => buttonOf(name, where, kitchens, chosen, path, choose));
    place.replaceChildren(make('span', { className: 'soft small', text: 'Trained here: ' }), ...buttons);
  }
}

/**
 * @param {string} name
 * @param {string[]} where it was trained
 * @param {string[]} kitchens of the draft
 * @param {any} chosen
 * @param {Path} path
 * @param {(path: Path, name: string) => void} choose
 */
function buttonOf(name, where, kitchens, chosen, path, choose) {
  const text = where.length === kitchens.length ? name : `${name} (in ${where.join(', ')} only)`;
  const button = make('button', { className: 'btn tiny', type: 'button', text });
  button.setAttribute('aria-pressed', String(name === chosen));
  button.addEventListener('click', () => choose(path, name));
  return button;
}

/** @param {Path} path */
function kindAt(path) {
  const keys = path.map((piece) => (typeof piece === 'number' ? '*' : piece)).join('.');
  if (/^(agents\.\*|tutorial\.agent|waiting_room\.agent)\.model$/.test(keys)) return 'agents';
  return /^(agents\.\*|tutorial\.agent|waiting_room\.agent)\.predictor$/.test(keys) ? 'predictors' : null;
}

/**
 * The kitchens in which the model of a field is needed.
 * @param {any} values
 * @param {Path} path
 * @returns {string[]}
 */
function kitchensOf(values, path) {
  if (path[0] === 'tutorial') return [String(values.tutorial?.layout?.name ?? 'practice')];
  const layouts = Array.isArray(values.layouts) ? values.layouts : [];
  return [...new Set(layouts.map((/** @type {any} */ one) => String(one?.name ?? '')))];
}

/**
 * Names with the draft's kitchens in which they can be used.
 * @param {'agents' | 'predictors'} kind
 * @param {string[]} kitchens
 * @param {OwnModels} own
 */
function namesFor(kind, kitchens, own) {
  /** @type {Map<string, string[]>} */
  const names = new Map();
  for (const kitchen of kitchens) {
    for (const name of own[kitchen]?.[kind] ?? []) names.set(name, [...(names.get(name) ?? []), kitchen]);
  }
  return names;
}
