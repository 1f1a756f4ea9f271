// The kitchen editor: drawing by pointer, touch and keyboard; checks while one draws; saving, import and export.

/** @import { Cell, Grid } from '../board/kitchen.js' */
/** @import { Findings, Trial } from './kitchen-findings.js' */

import { STEP } from '../board/kitchen.js';
import { Sprites } from '../board/sprites.js';
import { SPRITES, root } from '../browser/addresses.js';
import { find } from '../browser/dom.js';
import { make } from './elements.js';
import { KitchenDrawing } from './kitchen-drawing.js';
import { showModels, showProblems, showReach, showTrial, showUse } from './kitchen-findings.js';
import { TILES, TILE_NAMES, UndoList, drawn, filledUp, resized } from './kitchen-grid.js';
import { ARROWS, FIRST_TILE, listenToPalette } from './kitchen-palette.js';
import { newerVersion, note, offer, onFile, post, reasonOf } from './kitchen-requests.js';
import { listenToStrokes } from './kitchen-strokes.js';
import { UnsavedDrawing } from './kitchen-unsaved.js';

const CHECK_AFTER_MS = 150;
const TRY_AFTER_MS = 1000;
const RETRY_MS = 2000;

/** @type {{ name: string, rows: Grid, version: number, token: string, embedded: boolean }} */
const start = JSON.parse(find('#editor', HTMLElement).dataset.start ?? '');
const nameField = find('#name', HTMLInputElement);
const surface = find('#drawing', HTMLElement);

const unsaved = new UnsavedDrawing(start.name);
let list = new UndoList(start.rows);
let version = start.version;
/** @type {Cell} */
let cursor = [1, 1];
let tile = FIRST_TILE;
/** @type {Findings | null} */
let found = null;
let checks = 0;
/** @type {ReturnType<typeof setTimeout> | undefined} */
let checkTimer;
/** @type {ReturnType<typeof setTimeout> | undefined} */
let trialTimer;
/** @type {KitchenDrawing} */
let drawing;

function redraw() {
  drawing.show(list.now);
  find('#columns', HTMLInputElement).value = String(list.now[0].length);
  find('#rows', HTMLInputElement).value = String(list.now.length);
  find('#undo', HTMLButtonElement).disabled = !list.before.length;
  find('#redo', HTMLButtonElement).disabled = !list.after.length;
  moveTo(cursor);
}

function mark() {
  /** @type {Cell[]} */
  const problems = (found?.problems ?? []).flatMap(({ row, column }) =>
    row !== null && column !== null ? [/** @type {Cell} */ ([column - 1, row - 1])] : [],
  );
  drawing.mark(cursor, problems, found?.reach ?? null);
}

/** @param {Cell} cell */
function moveTo([x, y]) {
  const grid = list.now;
  cursor = [Math.min(grid[0].length - 1, Math.max(0, x)), Math.min(grid.length - 1, Math.max(0, y))];
  const here = grid[cursor[1]][cursor[0]];
  const wrong = found?.problems.find(({ row, column }) => row === cursor[1] + 1 && column === cursor[0] + 1);
  const place = `Row ${cursor[1] + 1}, column ${cursor[0] + 1}: ${TILE_NAMES[here] ?? here}`;
  find('#at', HTMLElement).textContent = wrong ? `${place}. ${wrong.text}` : place;
  mark();
}

/** The grid has changed: draw it, store it in this browser, and let the server check it. */
function changed() {
  found = null;
  redraw();
  keep();
  check();
}

function keep() {
  unsaved.keep({ rows: list.now, name: nameField.value, version });
  find('#saved', HTMLElement).textContent = 'Not saved';
  showUse(nameField.value);
}

function check() {
  clearTimeout(checkTimer);
  clearTimeout(trialTimer);
  const number = ++checks;
  checkTimer = setTimeout(async () => {
    const { status, data } = await post(start.token, 'kitchens/check', {
      grid: list.now.join('\n'),
      name: nameField.value,
    });
    if (number !== checks) return;
    if (status !== 200) return note(reasonOf(status, data), true);
    found = data;
    showFindings(data);
    if (!data.problems.length && !data.trial) trialTimer = setTimeout(() => tryOut(number), TRY_AFTER_MS);
  }, CHECK_AFTER_MS);
}

/** @param {Findings} findings */
function showFindings({ problems, reach, models, trial }) {
  showProblems(problems, (cell) => {
    surface.focus();
    moveTo(cell);
  });
  showReach(reach, list.now);
  showModels(models, nameField.value);
  showTrial(trial ?? null, problems.length ? 'Known once there are no errors.' : 'Two planners play it ...');
  moveTo(cursor);
}

/** @param {number} number of the check that found no errors */
async function tryOut(number) {
  const { status, data } = await post(start.token, 'kitchens/trial', { grid: list.now.join('\n') });
  if (number !== checks) return;
  if (status === 200) showTrial(/** @type {Trial} */ (data), '');
  else if (status === 503) trialTimer = setTimeout(() => tryOut(number), RETRY_MS);
  else showTrial(null, reasonOf(status, data));
}

/** @param {Cell[]} cells @param {string} what */
function put(cells, what) {
  if (list.add(drawn(list.now, cells, what))) changed();
}

/** @param {KeyboardEvent} event */
function onKey(event) {
  const key = event.key.length === 1 ? event.key.toUpperCase() : event.key;
  if (event.ctrlKey || event.metaKey) {
    if (key === 'Z' ? (event.shiftKey ? list.redo() : list.undo()) : key === 'Y' && list.redo()) changed();
    if (key !== 'Z' && key !== 'Y') return;
  } else if (event.altKey || key === 'Tab') {
    return;
  } else if (key in ARROWS) {
    const [dx, dy] = STEP[ARROWS[key]];
    if (event.shiftKey) put([cursor], tile);
    moveTo([cursor[0] + dx, cursor[1] + dy]);
    if (event.shiftKey) put([cursor], tile);
  } else if (TILES.includes(key)) {
    put([cursor], key);
  } else if (key === 'Delete' || key === 'Backspace') {
    put([cursor], ' ');
  } else if (key === 'Enter') {
    put([cursor], tile);
  } else {
    return;
  }
  event.preventDefault();
}

/** Undo reverts one whole stroke of a pointer. */
function listenToPointer() {
  /** @type {Grid} */
  let before = list.now;
  listenToStrokes(surface, (event) => drawing.cellAt(event), {
    begin: () => {
      before = list.now;
    },
    draw: (cells, last) => {
      moveTo(last);
      list.now = drawn(list.now, cells, tile);
      drawing.show(list.now);
      mark();
    },
    end: () => {
      const after = list.now;
      list.now = before;
      if (list.add(after)) changed();
    },
  });
}

async function save() {
  const button = find('#save', HTMLButtonElement);
  const name = nameField.value.trim();
  const rows = list.now.join('\n');
  button.disabled = true;
  const opened = name === start.name ? version : 0;
  const { status, data } = await post(start.token, 'kitchens/save', { name, grid: rows, version: String(opened) });
  button.disabled = false;
  if (status === 200) {
    const isNewName = name !== start.name;
    version = data.version;
    note('');
    if (rows !== list.now.join('\n')) {
      start.name = name; // drawn while it was saved: the next version of the same kitchen
      return keep();
    }
    unsaved.forget();
    if (start.embedded) return window.parent.postMessage({ kitchen: name }, window.location.origin);
    if (isNewName) return window.location.assign(`${root}/admin/kitchen/${name}`);
    find('#saved', HTMLElement).textContent = `Saved as version ${version}`;
    check(); // the server has its file now
  } else if (status === 409 && data.newest) {
    const choices = newerVersion(name, data.newest, () => {
      start.name = name;
      version = data.newest;
      save();
    });
    note(`${reasonOf(status, data)} Your drawing is kept. `, true, ...choices);
  } else {
    note(reasonOf(status, data), true);
    if (status === 400) nameField.focus();
  }
}

/** @param {string} text @param {string} name of the file */
async function take(text, name = '') {
  const { status, data } = await post(start.token, 'kitchens/check', { grid: text, name: '' });
  if (status !== 200) return note(reasonOf(status, data), true);
  /** @type {Findings} */
  const findings = data;
  if (!findings.rows?.some((row) => row.trim())) {
    return note(`This cannot be imported. ${findings.problems.map((problem) => problem.text).join(' ')}`, true);
  }
  const plain = name.replace(/\.layout$/, '').toLowerCase();
  if (!nameField.value && /^[a-z][a-z0-9_]{0,39}$/.test(plain)) nameField.value = plain;
  const isRagged = new Set(findings.rows.map((row) => row.length)).size > 1;
  note(isRagged ? 'The rows had different lengths. Short ones are filled up with counters.' : '');
  if (list.add(filledUp(findings.rows))) changed();
  surface.scrollIntoView({ block: 'nearest' });
}

function listen() {
  if (start.embedded) {
    addEventListener('keydown', (event) => {
      if (event.key === 'Escape') window.parent.postMessage({ kitchen: '' }, window.location.origin);
    });
  }
  surface.addEventListener('keydown', onKey);
  listenToPointer();
  find('#undo', HTMLElement).addEventListener('click', () => list.undo() && changed());
  find('#redo', HTMLElement).addEventListener('click', () => list.redo() && changed());
  for (const id of ['#columns', '#rows']) {
    find(id, HTMLInputElement).addEventListener('change', () => {
      const [columns, rows] = ['#columns', '#rows'].map((each) => find(each, HTMLInputElement));
      if (columns.checkValidity() && rows.checkValidity()) {
        if (list.add(resized(list.now, Number(columns.value), Number(rows.value)))) return changed();
      }
      redraw();
    });
  }
  nameField.addEventListener('input', () => {
    keep();
    check();
  });
  find('#save', HTMLElement).addEventListener('click', save);
  find('#export', HTMLElement).addEventListener('click', () => {
    offer(new Blob([`${list.now.join('\n')}\n`], { type: 'text/plain' }), `${nameField.value || 'kitchen'}.layout`);
  });
  find('#picture', HTMLElement).addEventListener('click', async () => {
    offer(await drawing.picture(), `${nameField.value || 'kitchen'}.png`);
  });
  find('#import', HTMLElement).addEventListener('click', () => take(find('#pasted', HTMLTextAreaElement).value));
  onFile(find('#file', HTMLInputElement), take);
  let width = 0;
  new ResizeObserver(([{ contentRect }]) => {
    if (contentRect.width !== width) redraw();
    width = contentRect.width;
  }).observe(find('#board', HTMLElement));
}

/** Restore an unsaved drawing after the browser was closed. */
function restore() {
  const draft = unsaved.read(start.rows);
  if (!draft) return;
  list.add(filledUp(draft.rows));
  if (!start.name && typeof draft.name === 'string') nameField.value = draft.name;
  if (Number.isInteger(draft.version)) version = draft.version;
  const discard = make('button', { className: 'btn tiny', type: 'button', text: 'Discard it' });
  discard.addEventListener('click', () => {
    unsaved.forget();
    window.location.reload();
  });
  note('This is what you drew in this browser and did not save. ', false, discard);
  find('#saved', HTMLElement).textContent = 'Not saved';
}

async function begin() {
  const sprites = await new Sprites(SPRITES).load();
  const canvas = find('#kitchen', HTMLCanvasElement);
  drawing = new KitchenDrawing(find('#board', HTMLElement), canvas, find('#overlay', SVGSVGElement), sprites);
  restore();
  listenToPalette((chosen) => {
    tile = chosen;
  });
  redraw();
  listen();
  showUse(nameField.value);
  check();
  find('#editor', HTMLElement).dataset.ready = 'yes';
}

begin();
