// The study's report, in a dialog of its page: make it, see how that goes, open it, download it.

import { find } from '../browser/dom.js';

const LOOK_EVERY_MS = 1000;
const dialog = find('#ask-report', HTMLDialogElement);
const { base = '' } = dialog.dataset;
const form = find('#report-make', HTMLFormElement);
const start = find('button:not([type])', HTMLButtonElement, form);
const stage = find('#report-stage', HTMLElement);
const running = find('#report-running', HTMLElement);
const missing = find('#report-missing', HTMLElement);
const kept = find('#report-kept', HTMLElement);
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;

/** @param {Researcher.ReportState} state */
function show(state) {
  running.hidden = !state.stage;
  say(state.stage ? `${state.stage}…` : state.failure, Boolean(state.failure) && !state.stage);
  missing.hidden = !state.missing;
  find('code', HTMLElement, missing).textContent = state.missing;
  kept.hidden = !state.kept;
  if (state.kept) find('p', HTMLElement, kept).textContent = wordsOf(state.kept);
  start.textContent = state.kept || state.failure ? 'Make it again' : 'Make a report';
  start.disabled = Boolean(state.stage || state.missing);
  clearTimeout(timer);
  if (state.stage) timer = setTimeout(look, LOOK_EVERY_MS);
}

/** @type {(words: string, isError: boolean) => void} */
function say(words, isError) {
  if (stage.textContent !== words) stage.textContent = words;
  stage.className = isError ? 'flag bad' : '';
}

/** @param {NonNullable<Researcher.ReportState['kept']>} report */
function wordsOf({ at, by, participants, simulated }) {
  const kind = `${simulated ? 'simulated ' : ''}participant${participants === 1 ? '' : 's'}`;
  const warning = simulated ? ' No evidence about people.' : '';
  return `Made on ${new Date(at).toLocaleString()} by ${by}: ${participants} ${kind} analysed.${warning}`;
}

/**
 * @param {string} route
 * @param {RequestInit} [options]
 */
async function ask(route, options) {
  try {
    const answer = await fetch(`${base}/${route}`, { ...options, headers: { Accept: 'application/json' } });
    const body = await answer.json();
    if (answer.ok) show(body);
    else say(body.detail, true);
  } catch {
    say('The server cannot be reached.', true);
    if (!running.hidden) timer = setTimeout(look, LOOK_EVERY_MS);
  }
}

function look() {
  if (dialog.open) void ask('report.json');
}

form.addEventListener('submit', (event) => {
  event.preventDefault();
  start.disabled = true;
  void ask('report', {
    method: 'POST',
    body: new URLSearchParams([...new FormData(form)].map(([k, v]) => [k, `${v}`])),
  });
});
find('[data-ask="report"]', HTMLElement).addEventListener('click', look);
look(); // on a slow network, the dialog can be opened before this script is here
