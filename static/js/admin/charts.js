// The two charts of the dashboard: people and lateness over time. Fetches now and then; the drawing is uPlot's.

import uPlot from '/static/vendor/uplot/uPlot.esm.js';

const EVERY_MS = 10_000, HEIGHT = 170;
const { study } = document.querySelector('#dashboard').dataset;
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const charts = new Map(); // id -> uPlot

function axis(extra = {}) {
  return { stroke: ink('--ink-soft'), grid: { stroke: ink('--line'), width: 1 }, ticks: { show: false }, font: '12px system-ui', ...extra };
}

function draw(id, series, data) {
  const place = document.querySelector(`#${id}`);
  place.hidden = data[0].length < 2;
  document.querySelector(`#${id}-none`).hidden = !place.hidden;
  if (place.hidden) return;
  if (!charts.has(id)) {
    const options = { width: place.clientWidth, height: HEIGHT, cursor: { y: false, points: { size: 6 } }, legend: { live: true }, scales: { y: { range: (_, low, high) => [0, Math.max(1, high * 1.1)] } },
      axes: [axis({ values: times, space: 60 }), axis({ size: 40 })], series: [{ label: 'at', value: (_, at) => (at === null ? '–' : when(at, true)) }, ...series] };
    charts.set(id, new uPlot(options, data, place));
  } else charts.get(id).setData(data);
}

const when = (seconds, long) => new Date(1000 * seconds).toLocaleString([], long ? { dateStyle: 'short', timeStyle: 'medium' } : { hour: '2-digit', minute: '2-digit', hourCycle: 'h23' });
const day = (seconds) => new Date(1000 * seconds).toLocaleDateString([], { day: '2-digit', month: '2-digit' });

/** Times of day; days where the chart spans more than two. */
function times(_, ticks) {
  const days = ticks.length > 1 && ticks.at(-1) - ticks[0] > 2 * 86_400;
  const words = ticks.map((tick) => (days ? day(tick) : when(tick)));
  return words.map((word, place) => (word === words[place - 1] ? '' : word));
}

const line = (label, name, dash) => ({ label, stroke: ink(name), width: 2, dash, points: { show: false }, spanGaps: false });

async function load() {
  const answer = await fetch(`/admin/s/${study}/course.json`, { headers: { accept: 'application/json' } });
  if (!answer.ok) return;
  const { machine, people } = await answer.json();
  draw('people-chart', [line('consented', '--warn', [4, 3]), line('completed', '--good')], [people.at, people.consented, people.completed]);
  draw('late-chart', [line('99th percentile, ms', '--bad'), line('median, ms', '--ink-soft', [4, 3])], [machine.at, machine.p99_ms, machine.p50_ms]);
}

addEventListener('resize', () => { for (const [id, chart] of charts) chart.setSize({ width: document.querySelector(`#${id}`).clientWidth, height: HEIGHT }); });
load();
setInterval(() => { if (!document.hidden) load(); }, EVERY_MS);
