// What the page itself knows of its game, and adds to what the server says.

/** @import { State } from '../board/state.js' */
/** @import { RoundScore } from './result.js' */

/**
 * @typedef {object} PageConfig
 * @property {string} socket
 * @property {string} sprites
 * @property {string[]} [lessons]
 * @property {number} away_s how long one pause may last, until the server says how long the next one may
 * @property {boolean} ready_page start was pressed on the page before
 * @property {string} [title] of the kitchen, in the language of this page
 * @property {boolean} [expects_partner] an agent in the place of another person is news to the participant
 * @property {RoundScore[]} [rounds]
 */

/**
 * Return the message with the name of the kitchen in the language of this page.
 * @param {Wire.FromServer} message
 * @param {PageConfig} config
 * @returns {Wire.FromServer}
 */
export function inOwnLanguage(message, { title }) {
  return message.type === 'welcome' && title ? { ...message, title } : message;
}

/**
 * Return the state after a message; a welcome tells a participant who expects a partner that there is none.
 * @param {State} state
 * @param {Wire.FromServer} message
 * @param {PageConfig} config
 * @returns {State}
 */
export function withNewsOfPartner(state, message, config) {
  const isNews = message.type === 'welcome' && message.partner === 'agent' && config.expects_partner;
  return isNews ? { ...state, alone: true } : state;
}
