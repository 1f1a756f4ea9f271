// The study builder's page: connects the form, the YAML, the checks and the saving of one draft.

import { find, findAll } from '../browser/dom.js';
import { jsonBlock } from '../browser/texts.js';
import { askForText } from './builder-conflict.js';
import { keyOf } from './builder-fields.js';
import { DraftForm } from './builder-form.js';
import { KitchenDialog, titleFor } from './builder-kitchens.js';
import { leadTo, quickFixButton } from './builder-problems.js';
import { DraftRequests } from './builder-requests.js';
import { DraftSaving, SAVING } from './builder-saving.js';
import { DraftSession } from './builder-session.js';
import { YamlPane } from './builder-yaml.js';
import { make, withCode } from './elements.js';

/** @typedef {import('./builder-requests.js').Problem} Problem */

const about = jsonBlock('about');
const requests = new DraftRequests(about.id);
const state = find('#save-state', HTMLElement);
const openButton = find('#open', HTMLButtonElement);
const openedAt = 'isOpen' in openButton.dataset ? String(about.revision) : '';
const pane = new YamlPane((text) => session.typed(text));

/** @type {(words: string, isGood: boolean) => void} */
function showState(text, isGood) {
  const words = text.startsWith('Saved') && session.operations.length > 0 ? SAVING : text; // not all is in the text yet
  if (state.textContent !== words) state.textContent = words;
  state.className = isGood ? '' : 'warn';
  showOpen();
}

/** Only the saved text can be opened, and only if it is another one than participants get. */
function showOpen() {
  const isSame = find('#open-revision', HTMLInputElement).value === openedAt;
  openButton.disabled = isSame || !state.textContent?.startsWith('Saved');
  find('#open-note', HTMLElement).hidden = !isSame;
}

const saving = new DraftSaving(requests, about, {
  state: showState,
  saved(revision) {
    find('#open-revision', HTMLInputElement).value = String(revision);
    showOpen();
  },
  conflict: (theirs) => void settle(theirs, saving.text),
  isBusy: () => session.operations.length > 0,
  merged(text) {
    session.adopt(text);
    find('#spoken', HTMLElement).textContent = 'Changes that somebody else has made were added.';
  },
});

const session = new DraftSession(requests, about.source, {
  text(text) {
    pane.show(text);
    saving.put(text);
    find('#undo', HTMLButtonElement).disabled = session.before.length === 0;
  },
  view(view) {
    form.show(view.values, view.problems, view.own);
    pane.mark(view.problems);
    list(view.problems);
    if (state.textContent === SAVING && session.operations.length === 0) saving.put(saving.text);
    document.body.dataset.checked = 'yes';
  },
  refused(words) {
    const place = find('#refused', HTMLElement);
    place.textContent = words;
    place.hidden = !words;
  },
});

/** @param {import('./builder-session.js').Operation} operation */
function change(operation) {
  session.change(operation);
  if (state.textContent?.startsWith('Saved')) showState(SAVING, true);
}

const form = new DraftForm(about.schema, about.sections, {
  change,
  waits: (path) => session.waits(path),
  suggestions,
  offers: { kitchens: about.kitchens, agents: about.known.agents },
  draw: (path, kitchen) => kitchens.open(kitchen, (name) => useKitchen(path, kitchen, name)),
  async markdown(text) {
    const { status, body } = await requests.post('markdown', { text });
    return status === 200 ? body.html : '';
  },
});

const kitchens = new KitchenDialog(about.kitchens, about.known.layouts);

/**
 * Name a kitchen that was drawn: where another one was, or as a new one of the list.
 * @param {(string | number)[]} path of the kitchen, or of the list
 * @param {any} kitchen as the draft has it
 * @param {string} name
 */
function useKitchen(path, kitchen, name) {
  if (kitchen === undefined) {
    const value = { name, title: titleFor(name, form.languages) };
    const list = form.valueAt(path);
    form.focusNext = keyOf([...path, list?.length ?? 0]);
    if (Array.isArray(list)) change({ do: 'insert', path, index: list.length, value });
    else change({ do: 'put', path, value: [value] });
    return;
  }
  if (kitchen.name !== name) change({ do: 'put', path: [...path, 'name'], value: name });
  if (kitchen.grid !== undefined) change({ do: 'remove', path: [...path, 'grid'] });
  session.look(); // the same name may be another grid now
}

/**
 * Names that can stand at a place of the study.
 * @param {(string | number)[]} path
 * @param {any} values
 * @returns {string[]}
 */
function suggestions(path, values) {
  const keys = path.map((piece) => (typeof piece === 'number' ? '*' : piece)).join('.');
  if (keys === 'layouts.*.name') return about.known.layouts;
  if (/^agents\.\*\.(name|model)$|agent\.(name|model)$/.test(keys)) return about.known.agents;
  if (/(agents\.\*|agent)\.predictor$/.test(keys)) return about.known.predictors;
  if (keys === 'after_episode') return Object.keys(values.questionnaires ?? {});
  if (keys !== 'flow.*') return [];
  const pages = [...Object.keys(values.pages ?? {}), ...Object.keys(values.questionnaires ?? {})];
  return ['introduction', 'quiz', 'tutorial', 'episodes', 'thanks', ...pages];
}

/**
 * @param {{ revision: number, text: string, author: string }} theirs
 * @param {string} mine
 */
async function settle(theirs, mine) {
  const text = await askForText(theirs, mine);
  if (text === theirs.text && (await requests.post('aside', { text: mine })).status !== 200) {
    return settle(theirs, mine); // not kept anywhere yet: ask again
  }
  await saving.resolve(theirs, text);
  session.adopt(text);
}

/** @param {Problem[]} problems */
function list(problems) {
  const wrong = problems.filter((one) => !one.warning).length;
  const warnings = problems.length - wrong;
  const words = problems.length === 0 ? 'none' : `${wrong} to correct, ${warnings} warning${warnings === 1 ? '' : 's'}`;
  find('#problem-count', HTMLElement).textContent = words;
  find('[data-count]', HTMLElement).textContent = problems.length ? `(${problems.length})` : '';
  const items = problems.map((one) => {
    const line = make('button', { className: 'link', type: 'button', text: `Line ${one.line}` });
    line.addEventListener('click', () => goToLine(one.line));
    const field = make('button', { className: 'link', type: 'button' }, place(one), ...withCode(one.text));
    field.addEventListener('click', () => goToField(one));
    return make(
      'li',
      { className: one.warning ? 'warn' : 'bad' },
      make('div', {}, line, field, ...quickFixButton(one, change)),
    );
  });
  const none = make('li', { className: 'none', text: 'No problems: the study can be opened.' });
  find('#problems', HTMLElement).replaceChildren(...(items.length ? items : [none]));
}

/** @param {Problem} problem */
function place(problem) {
  return problem.path.length ? `${problem.path.join('.')}: ` : '';
}

/** @param {number} line */
function goToLine(line) {
  choosePane('yaml');
  pane.goTo(line);
}

/** @param {Problem} problem */
function goToField(problem) {
  choosePane('form');
  if (leadTo(form.place, problem.path)) pane.scrollTo(problem.line);
  else goToLine(problem.line);
}

/** @param {string} name */
function choosePane(name) {
  find('#builder', HTMLElement).dataset.show = name;
  for (const button of findAll('[data-pane]', HTMLButtonElement)) {
    button.setAttribute('aria-pressed', String(button.dataset.pane === name));
  }
}

for (const button of findAll('[data-pane]', HTMLButtonElement)) {
  button.addEventListener('click', () => choosePane(button.dataset.pane ?? 'form'));
}
find('#undo', HTMLButtonElement).addEventListener('click', () => session.undo());
addEventListener('beforeunload', (event) => {
  if (session.operations.length > 0) event.preventDefault(); // changes of the form that are not in the text yet
});

pane.show(about.source);
const kept = saving.kept();
if (kept && kept.revision === about.revision) {
  session.typed(kept.text);
  find('#spoken', HTMLElement).textContent = 'Unsaved changes from this browser were restored.';
} else if (kept?.base !== undefined) {
  saving.goOnFrom(kept);
  session.typed(kept.text); // the server adds what others have saved since
} else if (kept) {
  saving.text = kept.text;
  saving.stop({ revision: about.revision, text: about.source, author: 'Somebody' });
}
void session.work();
