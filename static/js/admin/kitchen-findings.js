// The server's findings about a kitchen, as text next to the grid.

/** @import { Cell, Grid } from '../board/kitchen.js' */

import { cellsOf } from '../board/kitchen.js';
import { find } from '../browser/dom.js';
import { make } from './elements.js';

/** @typedef {{ row: number | null, column: number | null, text: string }} Problem */
/** @typedef {{ stations: [Cell[], Cell[]], shared: Cell[], alone: [boolean, boolean], together: boolean,
 *   unused: Cell[] }} Reach */
/** @typedef {{ layout: string, scripted: string[], agents: string[], predictors: string[], other_grid: string[],
 *   is_taken: boolean, is_saved: boolean, folder: string, results: string, commands: string[] }} Models */
/** @typedef {{ points: number[], steps: number, blocked: number }} Trial */
/** @typedef {{ rows: string[] | null, problems: Problem[], reach: Reach | null, models: Models | null,
 *   trial?: Trial | null }} Findings */

/** @type {[tile: string, name: string][]} */
const STATIONS = [
  ['O', 'Onions'],
  ['D', 'Dishes'],
  ['P', 'Pots'],
  ['S', 'Serving'],
];
const OFTEN = 0.2;
const SOMETIMES = 0.05;

/**
 * List the errors; each leads to its cell.
 * @param {Problem[]} problems
 * @param {(cell: Cell) => void} go
 */
export function showProblems(problems, go) {
  const items = problems.map(({ row, column, text }) => {
    if (row === null || column === null) return make('li', {}, make('b', { className: 'warn', text }));
    const place = make('button', { className: 'link', type: 'button', text: `Row ${row}, column ${column}` });
    place.addEventListener('click', () => go([column - 1, row - 1]));
    return make('li', {}, place, `: ${text}`);
  });
  const fine = make('li', { className: 'fine', text: 'No errors: this kitchen can be played.' });
  find('#problems', HTMLElement).replaceChildren(...(items.length ? items : [fine]));
  find('#problem-count', HTMLElement).textContent = items.length ? String(items.length) : '';
}

/**
 * @param {Reach | null} reach
 * @param {Grid} grid
 */
export function showReach(reach, grid) {
  const place = find('#reach', HTMLElement);
  if (!reach) return place.replaceChildren(make('p', { className: 'soft', text: 'Known once there are no errors.' }));
  const head = ['Station', 'Blue chef (1)', 'Green chef (2)'].map((text) => make('th', { scope: 'col', text }));
  const rows = STATIONS.map(([tile, name]) => {
    const cells = cellsOf(grid, tile);
    const counts = reach.stations.map((reached) => {
      const count = reached.filter(([x, y]) => grid[y][x] === tile).length;
      return make('td', { text: count ? `${count} of ${cells.length}` : 'none', className: count ? '' : 'warn' });
    });
    return make('tr', {}, make('th', { scope: 'row', text: name }), ...counts);
  });
  const parts = [make('table', {}, make('thead', {}, make('tr', {}, ...head)), make('tbody', {}, ...rows))];
  place.replaceChildren(...parts, make('p', { text: together(reach), className: reach.together ? '' : 'warn' }));
  if (reach.unused.length) {
    const text = `No chef can walk to ${reach.unused.length} floor cells (shaded).`;
    place.append(make('p', { className: 'warn', text }));
  }
}

/** @param {Reach} reach */
function together({ alone, together, shared }) {
  const counters = `${shared.length} counter${shared.length === 1 ? '' : 's'}`;
  if (!together) return 'No soup can be served: the two chefs cannot hand over what is needed.';
  if (alone[0] && alone[1]) return 'Each chef can serve soups alone.';
  if (alone[0] || alone[1]) return `Only the ${alone[0] ? 'blue' : 'green'} chef can serve soups alone.`;
  return `The chefs need each other: together they can serve soups. They share ${counters}.`;
}

/**
 * @param {Trial | null} trial
 * @param {string} otherwise the text if there is no trial
 */
export function showTrial(trial, otherwise) {
  const place = find('#trial', HTMLElement);
  if (!trial) return place.replaceChildren(make('p', { className: 'soft', text: otherwise }));
  const { points, blocked } = trial;
  const mean = points.reduce((sum, one) => sum + one, 0) / points.length;
  const words =
    blocked > OFTEN ? 'often in the way' : blocked > SOMETIMES ? 'sometimes in the way' : 'rarely in the way';
  const facts = [
    ['Points', `${Math.round(mean)} on average (${Math.min(...points)} to ${Math.max(...points)})`],
    ['Blocked steps', `${(100 * blocked).toFixed(1)} %: ${words}`],
  ];
  place.replaceChildren(
    make('dl', {}, ...facts.flatMap(([name, text]) => [make('dt', { text: name }), make('dd', { text })])),
    make('p', {
      className: 'soft small',
      text:
        `Two scripted planners, ${points.length} episodes of 400 timesteps. A step is blocked if the other chef ` +
        'is in the way. Trained agents usually do better.',
    }),
  );
}

/**
 * @param {Models | null} models
 * @param {string} name of the kitchen
 */
export function showModels(models, name) {
  const place = find('#models', HTMLElement);
  if (!models) return place.replaceChildren(make('p', { className: 'soft', text: 'Known once there are no errors.' }));
  const trained = models.agents.length > 0;
  const facts = [
    ['For every kitchen', models.scripted.join(', ')],
    ['Trained agents', models.agents.join(', ') || 'none'],
    ['Predictors', ['random', ...models.predictors].join(', ')],
  ];
  place.replaceChildren(
    make('dl', {}, ...facts.flatMap(([title, text]) => [make('dt', { text: title }), make('dd', { text })])),
  );
  if (trained && models.layout !== name) {
    const text = `The trained ones belong to the bundled kitchen ${models.layout}, which has the same grid.`;
    place.append(make('p', { className: 'soft small', text: `${text} Name that kitchen in the study to use them.` }));
  }
  if (!trained) {
    const text =
      'No agent and no predictor is trained for this kitchen yet. In a study, choose planner as the agent and ' +
      'random as its predictor (it guesses), or train your own.';
    place.append(make('p', { className: 'warn', text }));
  }
  if (models.other_grid.length) {
    const text = `Trained for an earlier grid of this name, not for this one: ${models.other_grid.join(', ')}.`;
    place.append(make('p', { className: 'warn', text }));
  }
  place.append(...(models.is_saved ? commandsOf(models) : [saveFirst(name, models.is_taken)]));
}

/**
 * @param {string} name
 * @param {boolean} isTaken a bundled kitchen with another grid has this name
 */
function saveFirst(name, isTaken) {
  if (isTaken) {
    const text = `${name} is a bundled kitchen with another grid. Give this one another name and save it.`;
    return make('p', { className: 'warn', text });
  }
  const text = name
    ? 'Save the kitchen: then the commands that train for it are here.'
    : 'Give the kitchen a name and save it: then the commands that train for it are here.';
  return make('p', { text });
}

/**
 * The commands as they are typed on the server, and where their results are found.
 * @param {Models} models
 */
function commandsOf({ commands, folder, results }) {
  const code = (/** @type {string} */ text) => make('code', { text });
  return [
    make(
      'p',
      {},
      'These commands train an agent, partners for it, and a predictor. Run them on the server, in ',
      code(folder),
      ':',
    ),
    make('pre', { tabindex: 0, 'aria-label': 'Commands that train' }, ...commands.map(code)),
    make(
      'p',
      { className: 'soft small' },
      'They need ',
      code("pip install 'kitchenmind[training]'"),
      '. Each result is in the lists of the study builder at once. To train on another machine, save the .layout ' +
        'file below, and put the folder of each result into ',
      code(results),
      ' here.',
    ),
  ];
}

/**
 * Show how a study file names the kitchen.
 * @param {string} name '' if it has none yet
 */
export function showUse(name) {
  const shown = name || 'NAME';
  find('#use', HTMLElement).textContent = `layouts:\n  - {name: ${shown}, title: {en: "${shown}"}}`;
}
