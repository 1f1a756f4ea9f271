// The card of one running game on the dashboard.

/** @import { BoardThumbnail } from './board-thumbnail.js' */

import { root } from '../browser/addresses.js';
import { clock, make } from './elements.js';

const LEVELS = ['', 'warn', 'bad'];
const FLAGS = ['ok', 'warn', 'bad'];

/** @typedef {ReturnType<typeof newParts>} CardParts */
/**
 * @typedef {object} CardEntry
 * @property {HTMLElement} item
 * @property {HTMLElement} link
 * @property {CardParts} parts
 * @property {Researcher.Card} card
 * @property {BoardThumbnail | null} board
 */

function newParts() {
  return {
    who: make('b'),
    arm: make('span', { className: 'cond' }),
    episode: make('span', { className: 'end' }),
    canvas: make('canvas', { 'aria-hidden': 'true' }),
    time: make('progress', { max: 1, value: 0, 'aria-label': 'Time played' }),
    title: make('span'),
    score: make('span'),
    flag: make('span'),
    rtt: make('span'),
  };
}

/**
 * @param {Researcher.Card} card
 * @param {string} study
 * @returns {CardEntry}
 */
export function newCard(card, study) {
  const parts = newParts();
  const link = make(
    'a',
    { className: 'mini', href: `${root}/admin/s/${study}/game/${card.id}` },
    make('span', { className: 'h' }, parts.arm, parts.who, parts.episode),
    make('span', { className: 'b board' }, parts.canvas),
    make('span', { className: 't' }, parts.time),
    make('span', { className: 'f' }, parts.title, parts.score),
    make('span', { className: 's' }, parts.flag, parts.rtt),
  );
  const item = make('li', { 'data-episode': card.id, 'data-person': card.person }, link);
  return { item, link, parts, card, board: null };
}

/**
 * @param {CardEntry | undefined} entry
 * @param {Researcher.Card} card
 */
export function showCard(entry, card) {
  if (!entry) return;
  const { parts, link } = entry;
  entry.card = card;
  parts.who.textContent = card.who;
  parts.arm.textContent = '';
  parts.arm.className = card.arm ? `cond ${card.arm}` : '';
  parts.arm.title = card.arm ? `Condition: ${card.arm}` : '';
  parts.episode.textContent = `${card.episode} · ${card.agent}`;
  parts.time.value = card.horizon ? card.t / card.horizon : 0;
  parts.title.textContent = card.title;
  parts.score.textContent = `${card.score} pts`;
  const since = card.since_s !== null && card.level ? ` ${clock(card.since_s)}` : '';
  parts.flag.textContent = card.flag + since;
  parts.flag.className = `flag ${FLAGS[card.level]}`;
  parts.rtt.textContent = card.rtt_ms === null ? '' : `${card.rtt_ms} ms`;
  link.className = `mini ${LEVELS[card.level]}`;
}
