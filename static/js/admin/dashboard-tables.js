// The dashboard's numbers and tables, from one message of the server.

import { root } from '../browser/addresses.js';
import { find } from '../browser/dom.js';
import { make, percent } from './elements.js';

/** @typedef {{ study: string, blind: boolean, search: string, cardOf: Map<string, Researcher.Card> }} Page cardOf: the
 *   running game of a person */

const MAX_PEOPLE = 200;
const MAX_ERRORS = 8;

/** @param {string} id */
const place = (id) => find(`#${id}`, HTMLElement);

/**
 * Show everything.
 * @param {Researcher.Figures} figures
 * @param {Page} page
 */
export function showTables(figures, page) {
  showState(figures);
  showKeyNumbers(figures, page);
  showArms(figures.arms, page.blind);
  showSimulated(figures);
  place('flow').replaceChildren(...figures.flow.map(flowNode));
  showAccuracy(figures.accuracy);
  showMachine(figures);
  showPeople(figures.people, page);
  showClientErrors(figures.client_errors, page.study);
}

/**
 * Show whether the study runs, and what can be done: somebody else may have paused it since the page was loaded.
 * @param {Researcher.Figures} figures
 */
function showState({ paused, closed }) {
  const stopped = paused ? 'Paused' : 'Running';
  place('study-state').textContent = !closed ? stopped : paused ? 'Closed, paused' : 'Closed';
  place('study-state').className = `badge ${closed ? 'plain' : paused ? 'warn' : 'good'}`;
  const button = document.querySelector('#pause-study');
  if (!(button instanceof HTMLElement) || button.matches(':active')) return; // who may only watch has none
  button.dataset.ask = paused ? 'resume' : 'pause';
  button.textContent = paused ? 'Resume study…' : 'Pause study…';
  button.className = `btn ${paused ? 'main' : 'danger'}`;
}

/** @type {(id: string, value: string | number, unit?: string) => void} */
function showValue(id, value, unit = '') {
  place(id).replaceChildren(String(value), ...(unit ? [' ', make('small', { text: unit })] : []));
}

/** @type {(figures: Researcher.Figures, page: Page) => void} */
function showKeyNumbers({ arms, here, rehearsal, minutes, machine, accuracy }, { cardOf }) {
  /** @param {'completed' | 'active' | 'dropped'} name */
  const sum = (name) => arms.reduce((total, arm) => total + arm[name], 0);
  const targets = arms.flatMap((arm) => (arm.target === null ? [] : [arm.target]));
  const target = targets.length === arms.length ? targets.reduce((total, each) => total + each, 0) : null;
  const consented = sum('completed') + sum('active') + sum('dropped');
  showValue('k-games', cardOf.size);
  const who = rehearsal ? 'simulated' : here === 1 ? 'person' : 'people';
  place('k-here').textContent = `${here} ${who} in the study now`;
  showValue('k-completed', sum('completed'), target === null ? '' : `of ${target}`);
  place('k-active').textContent = `${sum('active')} in progress`;
  showValue('k-dropped', sum('dropped'), `of ${consented}`);
  place('k-dropped-note').textContent = consented ? `${percent(sum('dropped') / consented)} %` : '';
  showMinutes(minutes);
  showLateness(machine.late_ms);
  showOverallAccuracy(accuracy);
}

/** @param {Researcher.Figures} figures */
function showSimulated({ simulated, rehearsal }) {
  place('simulated').hidden = simulated === 0;
  const bots = `${simulated} simulated participant${simulated === 1 ? '' : 's'}`;
  place('simulated').textContent = rehearsal ? `${bots}: no evidence about people` : `${bots}, counted separately`;
}

/** @param {Researcher.Figures['minutes']} minutes */
function showMinutes(minutes) {
  const [low, median, high] = (minutes ?? []).map((value) => value.toFixed(0));
  showValue('k-minutes', median ?? '–', 'min');
  place('k-minutes-note').textContent = minutes ? `middle half ${low}–${high}` : 'nobody has finished yet';
}

/** @param {Researcher.Machine['late_ms']} late */
function showLateness(late) {
  showValue('k-late', late ? late[1].toFixed(1) : '–', 'ms');
  place('k-late-note').textContent = late ? `median ${late[0].toFixed(1)} ms` : 'no tick yet';
}

/** @param {Researcher.Figures['accuracy']} accuracy */
function showOverallAccuracy({ overall, n }) {
  const [share, low, high] = (overall ?? []).map(percent);
  showValue('k-accuracy', share ?? '–', '%');
  place('k-accuracy-note').textContent = overall ? `${low}–${high}, n = ${n}` : 'no game is over yet';
}

/** @type {(arms: Researcher.Arm[], blind: boolean) => void} */
function showArms(arms, blind) {
  const rows = arms.map((arm) => {
    const target = arm.target === null ? '' : ` / ${arm.target}`;
    const counts = [
      make('b', { text: arm.completed }),
      make('span', { className: 'soft', text: ` + ${arm.active}${target}` }),
    ];
    return make(
      'div',
      { className: `arm ${blind ? 'hidden-arm' : armClass(arm.kind)}` },
      make('span', { className: blind ? '' : `cond ${armClass(arm.kind)}`, text: arm.name }),
      armBar(arm),
      make('span', { className: 'num' }, ...counts),
    );
  });
  const notes = [imbalance(arms), ...simulatedByArm(arms)];
  place('arms').replaceChildren(...rows, ...notes.map((text) => make('p', { className: 'soft small', text })));
}

/** @param {Researcher.Arm} arm */
function armBar(arm) {
  const most = Math.max(1, arm.target ?? arm.completed + arm.active);
  /** @type {(count: number, className: string) => HTMLElement} */
  const part = (count, className) => {
    const element = make('i', { className });
    element.style.width = `${Math.min(100, (100 * count) / most)}%`;
    element.hidden = !count;
    return element;
  };
  const plan = arm.target === null ? '' : `, plan ${arm.target}`;
  const label = `${arm.completed} completed, ${arm.active} in progress, ${arm.dropped} left${plan}`;
  const parts = [part(arm.completed, ''), part(arm.active, 'p')];
  return make('span', { className: 'bar', role: 'img', 'aria-label': label }, ...parts);
}

/** @param {string} kind of predictor */
function armClass(kind) {
  return ['degraded', 'misleading'].includes(kind) ? 'tom' : kind;
}

/** @param {Researcher.Arm[]} arms */
function imbalance(arms) {
  const held = arms.filter((arm) => !arm.former).map((arm) => arm.completed + arm.active);
  const left = arms.map((arm) => `${arm.name} ${arm.dropped}`).join(', ');
  return `Largest gap between arms: ${Math.max(...held) - Math.min(...held)}. Left: ${left}.`;
}

/**
 * Say how many bots a study of people has, which have places of their own.
 * @param {Researcher.Arm[]} arms
 */
function simulatedByArm(arms) {
  if (!arms.some((arm) => arm.simulated)) return [];
  return [`Simulated, with places of their own: ${arms.map((arm) => `${arm.name} ${arm.simulated}`).join(', ')}.`];
}

/** @param {Researcher.FlowNode} node */
function flowNode(node) {
  const lost = Object.entries(node.lost);
  const total = lost.reduce((sum, [, count]) => sum + count, 0);
  /** @type {(className: string, words: string, count: number) => HTMLElement} */
  const row = (className, words, count) =>
    make('div', { className }, make('dt', { text: words }), make('dd', { text: count }));
  const counts = [...lost, ...Object.entries(node.flags ?? {})];
  const rows = counts.map(([words, count]) => row('row', words, count));
  if (lost.length) rows.unshift(row('out', 'Left', total));
  if (node.here) rows.push(row('row', 'there now', node.here));
  const head = make('div', { className: 'node' }, make('span', { text: node.name }), make('b', { text: node.reached }));
  return make('li', {}, head, make('dl', {}, ...rows));
}

/** @param {Researcher.Figures['accuracy']} accuracy */
function showAccuracy({ rows, waiting }) {
  place('accuracy').replaceChildren(...rows.flatMap(accuracyRows));
  const still = waiting ? ` ${waiting} games are still to be counted.` : '';
  const note = `Wilson intervals over timesteps, all conditions.${still}`;
  place('accuracy-note').textContent = rows.length || waiting ? note : 'Counted when games are over.';
}

/**
 * Of the predicted steps, and of the intentions if the predictor has some.
 * @param {Researcher.AccuracyRow} row
 */
function accuracyRows({ agent, layout, steps, share, low, high, intention, episodes }) {
  const name = `${agent} · ${layout}`;
  const title = `steps 1 / 2 / 3: ${steps.map(percent).join(' / ')} %`;
  const rows = [accuracyRow(name, title, [share, low, high], episodes)];
  const meaning = 'kind and station, where something was done within 20 timesteps';
  return intention ? [...rows, accuracyRow(`${name}, intention`, meaning, intention, episodes)] : rows;
}

/** @type {(name: string, title: string, share: [number, number, number], episodes: number) => HTMLElement} */
function accuracyRow(name, title, [share, low, high], episodes) {
  return make(
    'tr',
    { title },
    make('td', { text: name }),
    make('td', { className: 'num', text: `${percent(share)} %` }),
    make('td', { className: 'num', text: `${percent(low)}–${percent(high)}` }),
    make('td', { className: 'num', text: episodes }),
  );
}

/** @param {Researcher.Figures} figures */
function showMachine({ machine, stored, display }) {
  /** @param {[number, number] | null} pair */
  const times = (pair) => (pair ? `${pair[0].toFixed(1)} / ${pair[1].toFixed(1)} ms` : '–');
  const games = `${display.games} game${display.games === 1 ? '' : 's'}`;
  /** @type {[string, string | number][]} */
  const rows = [
    ['Models p50 / p99, sampled', times(machine.models_ms)],
    ['Tick lateness p50 / p99', times(machine.late_ms)],
    ['Games held, moving', `${machine.games}, ${machine.moving}`],
    ['Sockets open', machine.sockets],
    ['Timesteps not shown as the condition requires', display.timesteps ? `${display.timesteps} in ${games}` : 'none'],
    ...lateRows(display),
    ['Episodes done / aborted', `${stored.done ?? 0} / ${stored.aborted ?? 0}`],
    ['Database', machine.database_mb === undefined ? 'PostgreSQL' : `${machine.database_mb} MB`],
    ['Disk free', machine.disk_free_gb === undefined ? '–' : `${machine.disk_free_gb} GB`],
  ];
  const cells = rows.flatMap(([name, value]) => [make('dt', { text: name }), make('dd', { text: value })]);
  place('machine').replaceChildren(...cells);
}

/** @type {(display: Researcher.Figures['display']) => [string, string | number][]} */
function lateRows({ timesteps, late }) {
  return timesteps ? [['– of these, because the server was late', `${late} of ${timesteps}`]] : [];
}

/** @type {(rows: Researcher.Person[], page: Page) => void} */
function showPeople(rows, page) {
  if (place('people').contains(document.activeElement)) return;
  const wanted = page.search.trim().toLowerCase();
  const chosen = rows.filter((row) => row.who.toLowerCase().includes(wanted));
  place('people').replaceChildren(...chosen.map((row) => personRow(row, page)));
  const limit = rows.length >= MAX_PEOPLE ? ` (the ${MAX_PEOPLE} seen last)` : '';
  place('people-note').textContent = `${chosen.length} shown${limit}`;
}

/** @type {(row: Researcher.Person, page: Page) => HTMLElement} */
function personRow(row, { study, cardOf }) {
  const card = cardOf.get(row.id);
  const name = make('a', { href: `${root}/admin/s/${study}/person/${row.id}` }, make('b', { text: row.who }));
  const now = card
    ? [
        make('a', { href: `${root}/admin/s/${study}/game/${card.id}`, text: row.now }),
        make('span', { className: 'soft', text: ` t ${card.t}` }),
      ]
    : [row.now];
  const bar = make('progress', { max: row.steps, value: row.done, 'aria-label': 'Progress' });
  const mine = card?.person === row.id ? card : undefined; // the partner of a round may be the one who is flagged
  const rtt = mine?.rtt_ms ?? null;
  return make(
    'tr',
    { className: ['', 'warn', 'bad'][mine?.level ?? 0] },
    make('td', {}, name),
    make('td', {}, ...now),
    make('td', {}, make('span', { className: 'step-progress' }, bar, `${row.done}/${row.steps}`)),
    make('td', { className: 'num', text: card ? 'now' : ago(row.seen_s) }),
    make('td', { className: 'num', text: rtt === null ? '–' : `${rtt} ms` }),
    make('td', {}, ...personFlags(row, mine)),
    make('td', { className: row.arm ? '' : 'soft', text: row.arm || 'hidden' }),
    make('td', { className: 'num', text: row.minutes }),
  );
}

/** @type {(row: Researcher.Person, card: Researcher.Card | undefined) => HTMLElement[]} */
function personFlags(row, card) {
  const { drop, look } = row.quality;
  /** @type {[text: string, level: 'bad' | 'warn'][]} */
  const flags = [];
  if (card?.level) flags.push([card.flag, card.level === 2 ? 'bad' : 'warn']);
  if (row.excluded) flags.push(['excluded', 'bad']);
  if (drop) flags.push([`${drop} to drop`, 'bad']);
  if (look) flags.push([`${look} to review`, 'warn']);
  if (row.client_errors)
    flags.push([`${row.client_errors} browser error${row.client_errors === 1 ? '' : 's'}`, 'warn']);
  return flags.map(([text, level]) => make('span', { className: `flag ${level}`, text }));
}

/** @param {number} seconds */
function ago(seconds) {
  if (seconds < 120) return `${seconds} s`;
  return seconds < 7200 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

/** @type {(rows: Researcher.ClientError[], study: string) => void} */
function showClientErrors(rows, study) {
  const items = rows.slice(0, MAX_ERRORS).map(({ at, person, who, text }) => {
    const link = make('a', { href: `${root}/admin/s/${study}/person/${person}`, text: who });
    const time = make('time', { text: new Date(at).toLocaleTimeString() });
    return make('li', { className: 'warn' }, make('div', {}, make('b', {}, link), ` ${text}`), time);
  });
  place('client-errors').replaceChildren(
    ...(items.length ? items : [make('li', { className: 'none', text: 'None.' })]),
  );
}
