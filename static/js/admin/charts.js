// The two charts of the dashboard: people and lateness over time. uPlot draws them.

import uPlot from '../../vendor/uplot/uPlot.esm.js';

import { root } from '../browser/addresses.js';
import { find } from '../browser/dom.js';

const EVERY_MS = 10_000;
const HEIGHT = 170;
const DAY_S = 86_400;
const { study } = find('#dashboard', HTMLElement).dataset;
/** @type {Map<string, uPlot>} by id */
const charts = new Map();

/** @param {string} name */
function ink(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/**
 * @param {uPlot.Axis} extra
 * @returns {uPlot.Axis}
 */
function axis(extra) {
  const grid = { stroke: ink('--line'), width: 1 };
  return { stroke: ink('--ink-soft'), grid, ticks: { show: false }, font: '12px system-ui', ...extra };
}

/**
 * @param {string} id
 * @param {uPlot.Series[]} series
 * @param {uPlot.AlignedData} data
 */
function draw(id, series, data) {
  const place = find(`#${id}`, HTMLElement);
  place.hidden = data[0].length < 2;
  find(`#${id}-none`, HTMLElement).hidden = !place.hidden;
  if (place.hidden) return;
  const chart = charts.get(id);
  if (chart) chart.setData(data);
  else charts.set(id, new uPlot(options(place.clientWidth, series), data, place));
}

/**
 * @param {number} width
 * @param {uPlot.Series[]} series
 * @returns {uPlot.Options}
 */
function options(width, series) {
  return {
    width,
    height: HEIGHT,
    cursor: { y: false, points: { size: 6 } },
    legend: { live: true },
    scales: { y: { range: (_, _low, high) => [0, Math.max(1, high * 1.1)] } },
    axes: [axis({ values: times, space: 60 }), axis({ size: 56 })],
    series: [{ label: 'at', value: (_, at) => (at === null ? '–' : dateAndTime(at)) }, ...series],
  };
}

/** @param {number} seconds since 1970 */
function dateAndTime(seconds) {
  return new Date(1000 * seconds).toLocaleString([], { dateStyle: 'short', timeStyle: 'medium' });
}

/** @param {number} seconds since 1970 */
function timeOfDay(seconds) {
  return new Date(1000 * seconds).toLocaleString([], { hour: '2-digit', minute: '2-digit', hourCycle: 'h23' });
}

/** @param {number} seconds since 1970 */
function day(seconds) {
  return new Date(1000 * seconds).toLocaleDateString([], { day: '2-digit', month: '2-digit' });
}

/**
 * Return times of day, or days if the chart spans more than two. A label that repeats the last one is left out.
 * @param {uPlot} _
 * @param {number[]} ticks
 */
function times(_, ticks) {
  const days = ticks.length > 1 && ticks[ticks.length - 1] - ticks[0] > 2 * DAY_S;
  const labels = ticks.map((tick) => (days ? day(tick) : timeOfDay(tick)));
  return labels.map((label, place) => (label === labels[place - 1] ? '' : label));
}

/**
 * @param {string} label
 * @param {string} colour name of a colour of tokens.css
 * @param {number[]} [dash]
 * @returns {uPlot.Series}
 */
function line(label, colour, dash) {
  return { label, stroke: ink(colour), width: 2, dash, points: { show: false }, spanGaps: false };
}

/**
 * Let the last counts hold until now: with a single moment there is nothing to draw a line to.
 * @param {Researcher.History['people']} people
 * @returns {[number[], number[], number[]]}
 */
function untilNow({ at, consented, completed }) {
  const last = at.at(-1);
  if (last === undefined) return [at, consented, completed];
  const now = Math.max(Math.round(Date.now() / 1000), last + 1);
  return [
    [...at, now],
    [...consented, consented[consented.length - 1] ?? 0],
    [...completed, completed[completed.length - 1] ?? 0],
  ];
}

async function load() {
  const answer = await fetch(`${root}/admin/s/${study}/latency.json`, { headers: { accept: 'application/json' } });
  if (!answer.ok) return;
  /** @type {Researcher.History} */
  const { machine, people } = await answer.json();
  const consented = line('consented', '--warn', [4, 3]);
  draw('people-chart', [consented, line('completed', '--good')], untilNow(people));
  const median = line('median, ms', '--ink-soft', [4, 3]);
  draw('late-chart', [line('99th percentile, ms', '--bad'), median], [machine.at, machine.p99_ms, machine.p50_ms]);
}

addEventListener('resize', () => {
  for (const [id, chart] of charts) {
    chart.setSize({ width: find(`#${id}`, HTMLElement).clientWidth, height: HEIGHT });
  }
});
load();
setInterval(() => {
  if (!document.hidden) load();
}, EVERY_MS);
