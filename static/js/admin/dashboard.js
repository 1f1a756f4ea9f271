// The live overview of one study: cards of running games, those that need attention first, and the list of alerts.

/** @import { CardEntry } from './dashboard-card.js' */

import { Sprites } from '../board/sprites.js';
import { root, SPRITES } from '../browser/addresses.js';
import { find, findAll } from '../browser/dom.js';
import { BoardThumbnail } from './board-thumbnail.js';
import { newCard, showCard } from './dashboard-card.js';
import { showTables } from './dashboard-tables.js';
import { clock, make } from './elements.js';
import { listen } from './live-socket.js';

const SORT_EVERY_MS = 5000; // cards must not jump around, especially under the pointer
const SPEAK_EVERY_MS = 5000;
const MAX_BOARDS = 40;
const MAX_ALERTS = 12;
const LEVELS = ['', 'warn', 'bad'];
/** @type {[width: number, height: number]} */
const BOARD_SIZE = [164, 106];
const { study = '', blind } = find('#dashboard', HTMLElement).dataset;
const list = find('#boards', HTMLElement);
const alertList = find('#alerts', HTMLElement);
const search = find('#find', HTMLInputElement);
const sprites = new Sprites(SPRITES);
/** @type {Map<string, CardEntry>} by episode */
const cards = new Map();
/** @type {(message: object) => void} */
let send = () => {};
/** @type {Researcher.Figures | null} the last ones */
let figures = null;
/** @type {Researcher.Alert[] | null} the last ones */
let alerts = null;
/** @type {keyof typeof ORDERS} */
let order = 'attention';
let tab = 'active';
let sortedMs = 0;
let spokenMs = 0;
let spoken = '';

const inView = new IntersectionObserver(
  (entries) => {
    for (const { target, isIntersecting } of entries) {
      if (target instanceof HTMLElement) target.dataset.inView = isIntersecting ? 'yes' : 'no';
    }
    tellView();
  },
  { rootMargin: '80px' },
);

/** Tell the server which cards are in view: it sends only their boards. */
function tellView() {
  const shown = findAll('[data-in-view="yes"]', HTMLElement, list).map((item) => item.dataset.episode);
  send({ show: shown.slice(0, MAX_BOARDS), tab });
}

/** @param {Researcher.Card} card */
function addCard(card) {
  const entry = newCard(card, study);
  list.append(entry.item);
  inView.observe(entry.item);
  cards.set(card.id, entry);
}

/** @param {Set<string>} ids of the games that are still running */
function removeOthers(ids) {
  for (const [id, { item }] of cards) {
    if (ids.has(id)) continue;
    inView.unobserve(item);
    item.remove();
    cards.delete(id);
  }
}

/** @param {Researcher.Cards} message */
function showCards(message) {
  removeOthers(new Set(message.cards.map((card) => card.id)));
  const fresh = message.cards.filter((card) => !cards.has(card.id));
  fresh.forEach(addCard);
  for (const card of message.cards) showCard(cards.get(card.id), card);
  for (const [id, still] of Object.entries(message.still)) {
    const entry = cards.get(id);
    if (entry) entry.board = new BoardThumbnail(entry.parts.canvas, sprites, still, BOARD_SIZE);
  }
  for (const [id, board] of Object.entries(message.boards)) cards.get(id)?.board?.show(board);
  find('#no-games', HTMLElement).hidden = message.cards.length > 0;
  sort(fresh.length > 0);
  showAlerts(message.cards);
}

/** @typedef {(a: Researcher.Card, b: Researcher.Card) => number} Order */

const ORDERS = {
  /** @type {Order} */
  attention: (a, b) => b.level - a.level || a.who.localeCompare(b.who),
  /** @type {Order} */
  longest: (a, b) => b.episode.localeCompare(a.episode, 'en', { numeric: true }) || b.t - a.t,
  /** @type {Order} */
  who: (a, b) => a.who.localeCompare(b.who),
};

/** @param {boolean} now at once, even if the researcher is using the list */
function sort(now) {
  const inUse = list.matches(':hover') || list.contains(document.activeElement);
  if (!now && (performance.now() - sortedMs < SORT_EVERY_MS || inUse)) return;
  sortedMs = performance.now();
  const sorted = [...cards.values()].sort((a, b) => ORDERS[order](a.card, b.card));
  sorted.forEach(({ item }, place) => {
    if (list.children[place] !== item) list.insertBefore(item, list.children[place] ?? null);
  });
}

/**
 * Show the alerts of the server first, then the games that need attention.
 * @param {Researcher.Card[]} all
 */
function showAlerts(all) {
  const urgent = all.filter((card) => card.level).sort(ORDERS.attention);
  const ofServer = alerts ?? [];
  find('#attention', HTMLElement).textContent = attentionWords(ofServer.length, urgent.length);
  find('#alerts-count', HTMLElement).textContent = `${ofServer.length + urgent.length} open`;
  const rows = [...ofServer.map(serverAlert), ...urgent.slice(0, MAX_ALERTS).map(cardAlert)];
  if (!list.contains(document.activeElement) && !alertList.contains(document.activeElement)) {
    const none = make('li', { className: 'none', text: 'Nobody needs attention.' });
    alertList.replaceChildren(...(rows.length ? rows : [none]));
  }
  const worst = urgent.filter((card) => card.level === 2).map((card) => `${card.who} ${card.flag}`);
  speak([...ofServer.map(({ text }) => text), ...worst].join(', '));
}

/**
 * @param {number} ofServer
 * @param {number} urgent
 */
function attentionWords(ofServer, urgent) {
  const words = [];
  if (ofServer) words.push(`${ofServer} alert${ofServer === 1 ? '' : 's'}`);
  if (urgent) words.push(`${urgent} need${urgent === 1 ? 's' : ''} attention`);
  if (words.length) return words.join(', ');
  return alerts ? 'all calm' : ''; // unknown before the first alerts
}

/** @param {Researcher.Alert} alert */
function serverAlert({ text, path, since_s: since }) {
  const words = path ? make('div', {}, make('a', { href: `${root}${path}`, text })) : make('div', { text });
  return make('li', { className: 'bad' }, words, make('time', { text: clock(since) }));
}

/** @param {Researcher.Card} card */
function cardAlert(card) {
  const link = make('a', { href: `${root}/admin/s/${study}/game/${card.id}`, text: card.who });
  const words = make('div', {}, make('b', {}, link), ` ${card.flag.toLowerCase()}`);
  const time = make('time', { text: card.since_s === null ? '' : clock(card.since_s) });
  return make('li', { className: LEVELS[card.level] }, words, time);
}

/** @param {string} words for screen readers, at most every few seconds */
function speak(words) {
  if (words === spoken || performance.now() - spokenMs <= SPEAK_EVERY_MS) return;
  spoken = words;
  spokenMs = performance.now();
  find('#spoken', HTMLElement).textContent = words;
}

/**
 * @param {string} selector
 * @param {HTMLElement} chosen
 */
function press(selector, chosen) {
  for (const button of findAll(selector, HTMLElement)) button.setAttribute('aria-pressed', String(button === chosen));
}

function showFigures() {
  if (!figures) return;
  const cardOf = new Map(
    [...cards.values()].flatMap(({ card }) => card.people.map((person) => /** @type {const} */ ([person, card]))),
  );
  showTables(figures, { study, blind: blind === 'yes', search: search.value, cardOf });
}

for (const button of findAll('[data-order]', HTMLElement)) {
  button.addEventListener('click', () => {
    order = /** @type {keyof typeof ORDERS} */ (button.dataset.order);
    press('[data-order]', button);
    sort(true);
  });
}
for (const button of findAll('[data-tab]', HTMLElement)) {
  button.addEventListener('click', () => {
    tab = button.dataset.tab ?? 'active';
    press('[data-tab]', button);
    tellView();
  });
}
search.addEventListener('input', showFigures);

await sprites.load();
listen(`${root}/admin/s/${study}/live`, {
  open: (sendMessage) => {
    send = sendMessage;
    tellView();
  },
  message: (/** @type {Researcher.Cards | Researcher.Figures | Researcher.Alerts} */ message) => {
    if (message.type === 'cards') {
      showCards(message);
    } else if (message.type === 'alerts') {
      alerts = message.alerts;
      showAlerts([...cards.values()].map(({ card }) => card));
    } else {
      figures = message;
      showFigures();
    }
  },
});
