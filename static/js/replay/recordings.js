// Opens a file of recorded games: the server simulates them again, and the replay shows them. Nothing is stored.

import { root } from '../browser/addresses.js';
import { find } from '../browser/dom.js';
import { open } from './replay.js';

/** @param {string} id */
const place = (id) => find(`#${id}`, HTMLElement);
const input = find('#file', HTMLInputElement);
const list = find('#episode', HTMLSelectElement);
const token = find('#token [name=form_token]', HTMLInputElement).value;
const TOO_LARGE = 413;
const PROXY_REFUSED =
  'The proxy in front of the server refuses a file of this size. Open a smaller file, or set a higher limit there ' +
  '(nginx: client_max_body_size 32m).';
const NO_ANSWER = 'The server cannot be reached, or stopped reading. Try again; large files can be split.';
/** @type {Researcher.EpisodeRecord[]} */
let records = [];

/**
 * @param {string} words
 * @param {boolean} isProblem
 */
function say(words, isProblem = false) {
  place('status').textContent = words;
  place('status').className = isProblem ? 'flag bad' : '';
}

/** @param {File} file */
async function read(file) {
  say(`Reading ${file.name} …`);
  const found = await recordsOf(file);
  if (found) offer(found, file.name);
}

/**
 * Return the games of a file as the server simulated them; null, with the reason on the page, if it did not.
 * @param {File} file
 * @returns {Promise<Researcher.EpisodeRecord[] | null>}
 */
async function recordsOf(file) {
  const address = `${root}/admin/recordings/records.json?name=${encodeURIComponent(file.name)}`;
  let status = 0;
  try {
    const headers = { Accept: 'application/json', 'X-Form-Token': token };
    const answer = await fetch(address, { method: 'POST', body: file, headers });
    status = answer.status;
    const found = await answer.json();
    if (answer.ok) return found;
    say(String(found.detail), true);
  } catch {
    say(status === TOO_LARGE ? PROXY_REFUSED : NO_ANSWER, true);
  }
  return null;
}

/**
 * @param {Researcher.EpisodeRecord[]} found
 * @param {string} name
 */
function offer(found, name) {
  records = found;
  list.replaceChildren(...found.map((record, k) => new Option(titleOf(record, k), String(k))));
  place('shown').hidden = false;
  say(`${name}: ${found.length} ${found.length === 1 ? 'game' : 'games'}. All states follow from the rules.`);
  show();
}

/** @type {(record: Researcher.EpisodeRecord, k: number) => string} */
function titleOf({ game, rows }, k) {
  const { soups } = rows[rows.length - 1].state;
  return `${k + 1}: ${game.title}, ${rows.length - 1} timesteps, ${soups} soups`;
}

function show() {
  const record = records[Number(list.value)];
  open(record);
  place('checked').textContent = `${record.rows.length} states, simulated again by these rules.`;
}

function takeDrops() {
  document.addEventListener('dragover', (event) => event.preventDefault());
  document.addEventListener('drop', (event) => {
    event.preventDefault();
    const file = event.dataTransfer?.files[0];
    if (file) read(file);
  });
}

input.addEventListener('change', () => {
  if (input.files?.[0]) read(input.files[0]);
  input.value = ''; // the same file can be opened again
});
list.addEventListener('change', show);
takeDrops();
