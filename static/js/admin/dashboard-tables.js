// The dashboard's numbers and tables, from one message of the server. Knows no socket.

import { make, percent } from './admin-page.js';

const find = (name) => document.querySelector(`#${name}`);

/** Shows everything. `page`: {study, blind, find: text, flags: person -> card of the running game}. */
export function showFigures(figures, page) {
  keyFigures(figures, page);
  arms(figures.arms, page.blind);
  flow(figures.flow);
  accuracy(figures.accuracy);
  machine(figures);
  people(figures, page);
  troubles(figures.troubles, page);
}

function value(name, big, small = '') {
  find(name).replaceChildren(String(big), ...(small ? [' ', make('small', { text: small })] : []));
}

function keyFigures({ arms: all, here, minutes, machine: server, accuracy: hits }, { flags }) {
  const sum = (name) => all.reduce((total, arm) => total + arm[name], 0);
  const target = all.every((arm) => arm.target !== null) ? sum('target') : null;
  const consented = sum('completed') + sum('active') + sum('dropped');
  value('k-games', flags.size);
  find('k-here').textContent = `${here} ${here === 1 ? 'person' : 'people'} in the study now`;
  value('k-completed', sum('completed'), target === null ? '' : `of ${target}`);
  find('k-active').textContent = `${sum('active')} in progress`;
  value('k-dropped', sum('dropped'), `of ${consented}`);
  find('k-dropped-note').textContent = consented ? `${percent(sum('dropped') / consented)} %` : '';
  value('k-minutes', minutes ? minutes[1].toFixed(0) : '–', 'min');
  find('k-minutes-note').textContent = minutes ? `middle half ${minutes[0].toFixed(0)}–${minutes[2].toFixed(0)}` : 'nobody has finished yet';
  value('k-late', server.late_ms ? server.late_ms[1].toFixed(1) : '–', 'ms');
  find('k-late-note').textContent = server.late_ms ? `median ${server.late_ms[0].toFixed(1)} ms` : 'no tick yet';
  value('k-accuracy', hits.overall ? percent(hits.overall[0]) : '–', '%');
  find('k-accuracy-note').textContent = hits.overall ? `${percent(hits.overall[1])}–${percent(hits.overall[2])}, n = ${hits.n}` : 'no game is over yet';
}

function bar(arm) {
  const most = Math.max(1, arm.target ?? arm.completed + arm.active);
  const done = make('i'), playing = make('i', { className: 'p' });
  done.style.width = `${Math.min(100, 100 * arm.completed / most)}%`;
  playing.style.width = `${Math.min(100, 100 * arm.active / most)}%`;
  done.hidden = !arm.completed;
  playing.hidden = !arm.active;
  const words = `${arm.completed} completed, ${arm.active} in progress, ${arm.dropped} left${arm.target === null ? '' : `, plan ${arm.target}`}`;
  return make('span', { className: 'bar', role: 'img', 'aria-label': words }, done, playing);
}

function arms(all, blind) {
  find('arms').replaceChildren(...all.map((arm) => make('div', { className: `arm ${blind ? 'hidden-arm' : armClass(arm.kind)}` },
    make('span', { className: blind ? '' : `cond ${armClass(arm.kind)}`, text: arm.name }), bar(arm),
    make('span', { className: 'num' }, make('b', { text: arm.completed }), make('span', { className: 'soft', text: ` + ${arm.active}${arm.target === null ? '' : ` / ${arm.target}`}` })))),
  make('p', { className: 'soft small', text: imbalance(all) }));
}

const armClass = (kind) => (kind === 'degraded' ? 'tom' : kind);

function imbalance(all) {
  const held = all.map((arm) => arm.completed + arm.active);
  return `Largest gap between arms: ${Math.max(...held) - Math.min(...held)}. Left: ${all.map((arm) => `${arm.name} ${arm.dropped}`).join(', ')}.`;
}

function flow(nodes) {
  find('flow').replaceChildren(...nodes.map((node) => {
    const lost = Object.entries(node.lost);
    const rows = [];
    if (lost.length) rows.push(make('div', { className: 'out' }, make('dt', { text: 'Left' }), make('dd', { text: lost.reduce((sum, [, count]) => sum + count, 0) })));
    for (const [word, count] of [...lost, ...Object.entries(node.flags ?? {}), ...(node.here ? [['there now', node.here]] : [])]) rows.push(make('div', { className: 'row' }, make('dt', { text: word }), make('dd', { text: count })));
    return make('li', {}, make('div', { className: 'node' }, make('span', { text: node.name }), make('b', { text: node.reached })), make('dl', {}, ...rows));
  }));
}

function accuracy({ rows, waiting }) {
  find('accuracy').replaceChildren(...rows.map((row) => make('tr', { title: `steps 1 / 2 / 3: ${row.steps.map(percent).join(' / ')} %` },
    make('td', { text: `${row.agent} · ${row.layout}` }), make('td', { className: 'num', text: `${percent(row.share)} %` }),
    make('td', { className: 'num', text: `${percent(row.low)}–${percent(row.high)}` }), make('td', { className: 'num', text: row.episodes }))));
  find('accuracy-note').textContent = !rows.length && !waiting ? 'Counted when games are over.' : `Wilson intervals over timesteps, all conditions.${waiting ? ` ${waiting} games are still to be counted.` : ''}`;
}

function machine({ machine: server, stored, display }) {
  const times = (pair) => (pair ? `${pair[0].toFixed(1)} / ${pair[1].toFixed(1)} ms` : '–');
  const rows = [['Models p50 / p99, sampled', times(server.models_ms)], ['Tick lateness p50 / p99', times(server.late_ms)], ['Games held, moving', `${server.games}, ${server.moving}`], ['Sockets open', server.sockets],
    ['Timesteps not shown as the condition promises', display.timesteps ? `${display.timesteps} in ${display.games} game${display.games === 1 ? '' : 's'}` : 'none'],
    ['Episodes done / aborted', `${stored.done ?? 0} / ${stored.aborted ?? 0}`], ['Database', server.database_mb === undefined ? 'PostgreSQL' : `${server.database_mb} MB`], ['Disk free', server.disk_free_gb === undefined ? '–' : `${server.disk_free_gb} GB`]];
  find('machine').replaceChildren(...rows.flatMap(([name, words]) => [make('dt', { text: name }), make('dd', { text: words })]));
}

function people({ people: rows }, { study, flags, find: wanted }) {
  if (find('people').contains(document.activeElement)) return;
  const chosen = rows.filter((row) => row.who.toLowerCase().includes(wanted.trim().toLowerCase()));
  find('people').replaceChildren(...chosen.map((row) => personRow(row, study, flags.get(row.id))));
  find('people-note').textContent = `${chosen.length} shown${rows.length >= 200 ? ' (the 200 seen last)' : ''}`;
}

function personRow(row, study, card) {
  const notes = [];
  if (card?.level) notes.push(make('span', { className: `flag ${card.level === 2 ? 'bad' : 'warn'}`, text: card.flag }));
  if (row.excluded) notes.push(make('span', { className: 'flag bad', text: 'excluded' }));
  for (const [proposal, words] of [['drop', 'to drop'], ['look', 'to review']]) {
    if (row.quality[proposal]) notes.push(make('span', { className: `flag ${proposal === 'drop' ? 'bad' : 'warn'}`, text: `${row.quality[proposal]} ${words}` }));
  }
  if (row.troubles) notes.push(make('span', { className: 'flag warn', text: `${row.troubles} browser error${row.troubles === 1 ? '' : 's'}` }));
  const now = make('td', {}, card ? make('a', { href: `/admin/s/${study}/game/${card.id}`, text: row.now }) : row.now, ...(card ? [make('span', { className: 'soft', text: ` t ${card.t}` })] : []));
  return make('tr', { className: ['', 'warn', 'bad'][card?.level ?? 0] },
    make('td', {}, make('a', { href: `/admin/s/${study}/person/${row.id}` }, make('b', { text: row.who }))), now,
    make('td', {}, make('span', { className: 'way' }, make('progress', { max: row.steps, value: row.done, 'aria-label': 'Way' }), `${row.done}/${row.steps}`)),
    make('td', { className: 'num', text: card ? 'now' : ago(row.seen_s) }), make('td', { className: 'num', text: card?.rtt_ms === undefined || card.rtt_ms === null ? '–' : `${card.rtt_ms} ms` }),
    make('td', {}, ...notes), make('td', { className: row.arm ? '' : 'soft', text: row.arm || 'hidden' }), make('td', { className: 'num', text: row.minutes }));
}

function ago(seconds) {
  if (seconds < 120) return `${seconds} s`;
  return seconds < 7200 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

function troubles(rows, { study }) {
  find('troubles').replaceChildren(...(rows.length ? rows.slice(0, 8).map(({ at, person, who, text }) => make('li', { className: 'warn' },
    make('div', {}, make('b', {}, make('a', { href: `/admin/s/${study}/person/${person}`, text: who })), ` ${text}`), make('time', { text: new Date(at).toLocaleTimeString() })))
    : [make('li', { className: 'none', text: 'None.' })]));
}
