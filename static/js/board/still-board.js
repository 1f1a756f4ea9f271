// A board that is drawn without a connection: in a replay, a thumbnail, an introduction.

/** @import { State } from './state.js' */

import { apply, defaults } from './state.js';

/** @typedef {Pick<Wire.Welcome, 'grid' | 'seat' | 'watched_seat' | 'tick_ms' | 'horizon'>} StillPart */
/** @typedef {StillPart & Partial<Wire.Welcome>} Still what never changes in a game */

/**
 * Return the state of a board that is drawn without a connection.
 * @param {Still} still
 * @param {Wire.KitchenState} kitchen
 * @param {number} now in ms
 * @returns {State}
 */
export function boardState(still, kitchen, now) {
  /** @type {Wire.Welcome} */
  const welcome = {
    ...{ type: 'welcome', protocol: 0, episode: '', kind: 'episode', number: 0, episodes: 0, layout: '', title: '' },
    ...{ steps: 3, shows_predictions: true, resumed: false, partner: 'agent', show: 'always', view_radius: 0 },
    ...{ partner_seen: true, unknown: [], asked: true, display: 'actions', away_s: 0 },
    ...still,
    state: kitchen,
    endless: !still.horizon,
  };
  return { ...apply(defaults(), welcome, now), phase: 'playing' };
}

/**
 * Return the frame of a board that is drawn without a connection.
 * @param {Pick<Wire.Tick, 'state' | 'prediction'> & Partial<Wire.Tick>} part
 * @returns {Wire.Tick}
 */
export function tickOf(part) {
  /** @type {Wire.Tick['intention']} */
  const intention = [8, -1, -1, 95];
  const seen = { partner_seen: true, unknown: [], asked: true, intention, pad: '' };
  return { type: 'tick', actions: [4, 4], applied: -1, late: false, ...seen, ...part };
}
