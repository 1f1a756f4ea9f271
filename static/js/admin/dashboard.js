// The live overview of one study: cards of running games, sorted by who needs a look. The figures are dashboard-tables.js.

import { SmallBoard } from './board-thumbnail.js';
import { showFigures } from './dashboard-tables.js';
import { clock, listen, make } from './admin-page.js';
import { Sprites } from '../board/sprites.js';

const SORT_EVERY_MS = 5000; // calm cards must not jump, and none under the pointer
const SPEAK_EVERY_MS = 5000;
const LEVELS = ['', 'warn', 'bad'], WORDS = ['ok', 'warn', 'bad'];
const { study, blind } = document.querySelector('#dashboard').dataset;
const list = document.querySelector('#boards');
const find = (name) => document.querySelector(`#${name}`);
const sprites = new Sprites('/static/sprites/');
const cards = new Map(); // episode -> {item, parts, card, board}
let send = () => {};
let figures = null; // the last message of figures
let order = 'attention', tab = 'active', sortedMs = 0, spokenMs = 0, spoken = '';

const seen = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) target.dataset.inView = isIntersecting ? 'yes' : 'no';
  tellView();
}, { rootMargin: '80px' });

/** The server sends boards only for the cards in view. */
function tellView() {
  const show = [...list.children].filter((item) => item.dataset.inView === 'yes').map((item) => item.dataset.episode);
  send({ show: show.slice(0, 40), tab });
}

function newCard({ id, person }) {
  const parts = {
    who: make('b'), arm: make('span', { className: 'cond' }), episode: make('span', { className: 'end' }), canvas: make('canvas', { 'aria-hidden': 'true' }),
    time: make('progress', { max: 1, value: 0, 'aria-label': 'Time played' }), title: make('span'), score: make('span'), flag: make('span'), rtt: make('span'),
  };
  const link = make('a', { className: 'mini', href: `/admin/s/${study}/game/${id}` },
    make('span', { className: 'h' }, parts.arm, parts.who, parts.episode), make('span', { className: 'b board' }, parts.canvas), make('span', { className: 't' }, parts.time),
    make('span', { className: 'f' }, parts.title, parts.score), make('span', { className: 's' }, parts.flag, parts.rtt));
  const item = make('li', { 'data-episode': id, 'data-person': person }, link);
  list.append(item);
  seen.observe(item);
  return { item, link, parts, board: null };
}

function showCard(entry, card) {
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
  const long = card.since_s !== null && card.level ? ` ${clock(card.since_s)}` : '';
  parts.flag.textContent = card.flag + long;
  parts.flag.className = `flag ${WORDS[card.level]}`;
  parts.rtt.textContent = card.rtt_ms === null ? '' : `${card.rtt_ms} ms`;
  link.className = `mini ${LEVELS[card.level]}`;
}

function showCards(message) {
  const here = new Set(message.cards.map((card) => card.id));
  for (const [id, entry] of cards) if (!here.has(id)) { seen.unobserve(entry.item); entry.item.remove(); cards.delete(id); }
  let fresh = false;
  for (const card of message.cards) {
    if (!cards.has(card.id)) { cards.set(card.id, newCard(card)); fresh = true; }
    showCard(cards.get(card.id), card);
  }
  for (const [id, still] of Object.entries(message.still)) {
    const entry = cards.get(id);
    if (entry) entry.board = new SmallBoard(entry.parts.canvas, sprites, still, 164, 106);
  }
  for (const [id, board] of Object.entries(message.boards)) cards.get(id)?.board?.show(board);
  find('no-games').hidden = message.cards.length > 0;
  sort(fresh);
  alerts(message.cards);
}

const ORDERS = {
  attention: (a, b) => b.level - a.level || a.who.localeCompare(b.who),
  longest: (a, b) => b.episode.localeCompare(a.episode, 'en', { numeric: true }) || b.t - a.t,
  who: (a, b) => a.who.localeCompare(b.who),
};

function sort(now) {
  if (!now && (performance.now() - sortedMs < SORT_EVERY_MS || list.matches(':hover') || list.contains(document.activeElement))) return;
  sortedMs = performance.now();
  const sorted = [...cards.values()].sort((a, b) => ORDERS[order](a.card, b.card));
  sorted.forEach(({ item }, place) => { if (list.children[place] !== item) list.insertBefore(item, list.children[place] ?? null); });
}

/** What is wrong with the server comes first, then the games that need a look. */
function alerts(all) {
  const urgent = all.filter((card) => card.level).sort(ORDERS.attention);
  const wrong = figures?.alerts ?? [];
  const open = [[wrong.length, `${wrong.length} alert${wrong.length === 1 ? '' : 's'}`], [urgent.length, `${urgent.length} need${urgent.length === 1 ? 's' : ''} attention`]];
  const calm = figures ? 'all calm' : ''; // before the first figures nobody knows
  find('attention').textContent = open.filter(([count]) => count).map(([, words]) => words).join(', ') || calm;
  find('alerts-count').textContent = `${wrong.length + urgent.length} open`;
  const ofServer = wrong.map(({ text, since_s: since }) => make('li', { className: 'bad' }, make('div', { text }), make('time', { text: clock(since) })));
  const rows = ofServer.concat(urgent.slice(0, 12).map((card) => make('li', { className: LEVELS[card.level] },
    make('div', {}, make('b', {}, make('a', { href: `/admin/s/${study}/game/${card.id}`, text: card.who })), ` ${card.flag.toLowerCase()}`),
    make('time', { text: card.since_s === null ? '' : clock(card.since_s) }))));
  if (!list.contains(document.activeElement) && !find('alerts').contains(document.activeElement)) {
    find('alerts').replaceChildren(...(rows.length ? rows : [make('li', { className: 'none', text: 'Nobody needs attention.' })]));
  }
  const words = [...wrong.map(({ text }) => text), ...urgent.filter((card) => card.level === 2).map((card) => `${card.who} ${card.flag}`)].join(', ');
  if (words !== spoken && performance.now() - spokenMs > SPEAK_EVERY_MS) {
    [spoken, spokenMs] = [words, performance.now()];
    find('spoken').textContent = words;
  }
}

function press(selector, chosen) {
  for (const button of document.querySelectorAll(selector)) button.setAttribute('aria-pressed', String(button === chosen));
}

for (const button of document.querySelectorAll('[data-order]')) {
  button.addEventListener('click', () => { order = button.dataset.order; press('[data-order]', button); sort(true); });
}
for (const button of document.querySelectorAll('[data-tab]')) {
  button.addEventListener('click', () => { tab = button.dataset.tab; press('[data-tab]', button); tellView(); });
}

const showNews = () => showFigures(figures, { study, blind: blind === 'yes', find: find('find').value, flags: new Map([...cards.values()].map(({ card }) => [card.person, card])) });
find('find').addEventListener('input', () => { if (figures) showNews(); });

await sprites.load();
listen(`/admin/s/${study}/live`, {
  open: (tell) => { send = tell; tellView(); },
  message: (message) => {
    if (message.type === 'cards') showCards(message);
    else { figures = message; showNews(); }
  },
});
