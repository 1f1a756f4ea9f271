// A page of questions: keys 1-9 answer a scale, the first open question gets the focus, and answers survive a reload.

import { find, findAll } from '../browser/dom.js';
import { readJson, session } from '../browser/storage.js';
import { fillIn } from '../browser/texts.js';
import { readNumber } from './read-number.js';

/** @typedef {HTMLInputElement | HTMLTextAreaElement | HTMLSelectElement} Control */
/** @typedef {{ reason: string, [value: string]: string | number }} Fault reason: a key of the words in data-faults */

const form = find('#questions', HTMLFormElement);
/** @type {Record<string, string>} */
const words = JSON.parse(form.dataset.words ?? '{}');
/** @type {Record<string, string>} */
const reasons = JSON.parse(form.dataset.faults ?? '{}');
const draftKey = `answers:${form.dataset.step}`;
const fields = findAll('.q', HTMLElement, form);
const alertBox = find('#alert', HTMLElement);
const left = find('#left', HTMLElement);
const go = find('#go', HTMLButtonElement);
const NOT_DRAFTED = ['step', 'attempt', 'form_token'];
const CONTEXT_LENGTH = 20;

const CONTROL = /[\u0000-\u0008\u000b\u000c\u000e-\u001f\u007f-\u009f]/; // as in server/study/answer_checks.py

/** @type {(field: HTMLElement) => Control[]} */
const controls = (field) => [...field.querySelectorAll('input, textarea, select')].filter(isControl);
/** @type {(field: HTMLElement) => boolean} */
const required = (field) => 'required' in field.dataset;

/**
 * @param {unknown} element
 * @returns {element is Control}
 */
function isControl(element) {
  return [HTMLInputElement, HTMLTextAreaElement, HTMLSelectElement].some((type) => element instanceof type);
}

/** @type {(control: Control) => boolean} */
const isBox = (control) => /radio|checkbox/.test(control.type);
/** @type {(control: Control) => boolean} */
const isChecked = (control) => control instanceof HTMLInputElement && control.checked;

/**
 * Whether a question has an answer of the right form; the server checks what it means.
 * @param {HTMLElement} field
 */
function answered(field) {
  const all = controls(field);
  switch (field.dataset.type) {
    case 'scale':
    case 'choice':
    case 'multiple':
      return all.some(isChecked);
    case 'ranking':
      return new Set(all.map((each) => each.value).filter(Boolean)).size === all.length;
    default:
      return all[0].value.trim() !== '' && faultOf(field) === null;
  }
}

/**
 * Return why the text in a field is invalid; null if it is valid.
 * @param {HTMLElement} field
 * @returns {Fault | null}
 */
function faultOf(field) {
  const [input] = controls(field);
  if (field.dataset.type === 'number') return numberFault(input);
  const [index, most, length] = [input.value.search(CONTROL), Number(input.dataset.most), [...input.value].length];
  if (index < 0) return length > most ? { reason: 'long', most, length } : null;
  return { reason: 'control', before: input.value.slice(Math.max(0, index - CONTEXT_LENGTH), index) };
}

/**
 * @param {Control} input
 * @returns {Fault | null}
 */
function numberFault(input) {
  const range = { low: Number(input.dataset.low), high: Number(input.dataset.high) };
  const { value, reason } = readNumber(input.value);
  if (reason === 'missing_number') return { reason, ...range };
  if (reason) return { reason, given: input.value.trim() };
  if (!(value >= range.low && value <= range.high)) return { reason: 'missing_number', ...range };
  return input.dataset.whole !== undefined && value % 1 !== 0 ? { reason: 'whole' } : null;
}

/** @type {(control: Control) => boolean} */
const isFilled = (control) => isChecked(control) || (!isBox(control) && control.value.trim() !== '');
/** @type {(field: HTMLElement) => boolean} */
const begun = (field) => controls(field).some(isFilled);
const openFields = () => fields.filter((field) => (required(field) || begun(field)) && !answered(field));

function showProgress() {
  left.textContent = fillIn(words.answered, { done: fields.filter(answered).length, count: fields.length });
}

/** @param {HTMLElement[]} missing */
function markFields(missing) {
  for (const field of fields) {
    const wrong = missing.includes(field);
    if (wrong) explain(field);
    field.classList.toggle('missing', wrong);
    for (const each of controls(field)) {
      if (wrong) each.setAttribute('aria-invalid', 'true');
      else each.removeAttribute('aria-invalid');
    }
  }
}

/**
 * Say below a field what is wrong with the text in it.
 * @param {HTMLElement} field
 */
function explain(field) {
  if (!/^(text|number)$/.test(field.dataset.type ?? '')) return;
  const [input] = controls(field);
  const message = find('.msg', HTMLElement, field);
  const fault = input.value.trim() === '' ? null : faultOf(field);
  message.textContent = fault ? fillIn(reasons[fault.reason], fault) : (message.dataset.usual ?? '');
  if (fault?.reason === 'control' && !(input instanceof HTMLSelectElement)) selectControl(input);
}

/**
 * Select the character that is invisible.
 * @param {HTMLInputElement | HTMLTextAreaElement} input
 */
function selectControl(input) {
  const index = input.value.search(CONTROL);
  setTimeout(() => input.setSelectionRange(index, index + 1)); // after the field has got the focus
}

/** Take a text as a whole and say that it is too long: the browser would cut off the end of what is pasted. */
function takeWholeTexts() {
  for (const each of findAll('[data-type="text"] :is(input, textarea)', HTMLElement, form)) {
    each.dataset.most = each.getAttribute('maxlength') ?? 'Infinity';
    each.removeAttribute('maxlength');
  }
}

/** @param {HTMLElement[]} missing */
function showSummary(missing) {
  const kind = missing.some(begun) ? 'wrong' : 'open'; // an age of 12 is an answer
  const key = missing.length === 1 ? `${kind}_one` : `${kind}_many`;
  const bold = Object.assign(document.createElement('b'), {
    textContent: fillIn(words[key], { count: missing.length }),
  });
  const links = missing.flatMap((field, k) => [k ? ', ' : ' ', linkTo(field)]);
  find('p', HTMLElement, alertBox).replaceChildren(bold, ...links);
  alertBox.hidden = missing.length === 0;
}

/** @param {HTMLElement} field */
function linkTo(field) {
  const textContent = fillIn(words.question, { number: fields.indexOf(field) + 1 });
  return Object.assign(document.createElement('a'), { href: `#${field.id}`, textContent });
}

/** @param {HTMLElement} field */
function focusOn(field) {
  const all = controls(field);
  (all.find(isChecked) ?? all[0]).focus();
}

function saveDraft() {
  const draft = [...new FormData(form)].filter(([name]) => !NOT_DRAFTED.includes(name));
  session.setItem(draftKey, JSON.stringify(draft));
}

/** Put a draft of this tab back, unless the server has sent the answers with the page. */
function restoreDraft() {
  if (fields.some(begun)) return;
  for (const [name, value] of readJson(session, draftKey, [])) {
    for (const each of [...form.elements].filter(isControl)) {
      if (each.name !== name) continue;
      if (each instanceof HTMLInputElement && isBox(each)) each.checked = each.checked || each.value === value;
      else each.value = value;
    }
  }
}

/** @param {Event} event */
function changed(event) {
  /** @type {HTMLElement | null} */
  const field = event.target instanceof Element ? event.target.closest('.q') : null;
  if (!field) return;
  if (answered(field)) {
    field.classList.remove('missing');
    controls(field).forEach((each) => each.removeAttribute('aria-invalid'));
  } else if (field.dataset.type === 'text' && faultOf(field)?.reason === 'long') {
    field.classList.add('missing');
    explain(field);
  }
  if (!alertBox.hidden && !form.querySelector('.missing')) alertBox.hidden = true;
  saveDraft();
  showProgress();
}

/**
 * Return the digit 1-9 that a key writes, also where a keyboard wants Shift for digits or writes those of another
 * script; 0 for any other key.
 * @param {KeyboardEvent} event
 */
function digitOf(event) {
  if (/^[1-9]$/.test(event.key)) return Number(event.key);
  const place = /^Digit([1-9])$/.exec(event.code);
  return place && !event.shiftKey ? Number(place[1]) : 0;
}

/**
 * A digit answers the scale in focus, or else the first open one, and moves on.
 * @param {KeyboardEvent} event
 */
function digitPressed(event) {
  const number = digitOf(event);
  if (!number || event.repeat || event.ctrlKey || event.metaKey || event.altKey || event.isComposing) return;
  const focused = document.activeElement;
  if (isControl(focused) && /^(text|number|textarea|select-one)$/.test(focused.type)) return;
  const field = scaleToAnswer(focused);
  const radio = field && controls(field).find((each) => each.value === String(number));
  if (!field || !(radio instanceof HTMLInputElement)) return;
  event.preventDefault();
  radio.checked = true;
  radio.dispatchEvent(new Event('change', { bubbles: true }));
  const next = fields[fields.indexOf(field) + 1];
  if (next) focusOn(next);
  else go.focus();
}

/**
 * @param {Element | null} focused
 * @returns {HTMLElement | undefined}
 */
function scaleToAnswer(focused) {
  /** @type {(field: HTMLElement) => boolean} */
  const isScale = (field) => field.dataset.type === 'scale' && controls(field).length <= 9; // the whole answer
  /** @type {HTMLElement | null} */
  const here = focused?.closest('.q') ?? null;
  return here && isScale(here) ? here : fields.find((each) => isScale(each) && !answered(each));
}

/** @param {SubmitEvent} event */
function submitted(event) {
  const missing = openFields();
  markFields(missing);
  showSummary(missing);
  if (missing.length === 0) {
    go.disabled = true;
    return;
  }
  event.preventDefault();
  focusOn(missing[0]);
}

form.noValidate = true;
takeWholeTexts();
restoreDraft();
showProgress();
form.addEventListener('input', changed);
form.addEventListener('change', changed);
form.addEventListener('submit', submitted);
document.addEventListener('keydown', digitPressed);
// When the browser shows the page again from its cache, the button must work again.
addEventListener('pageshow', () => {
  go.disabled = false;
});
alertBox.addEventListener('click', (event) => {
  const href = event.target instanceof Element ? event.target.getAttribute('href') : null;
  const field = fields.find((each) => `#${each.id}` === href);
  if (!field) return;
  event.preventDefault();
  focusOn(field);
});
/** @type {HTMLElement | null} */
const faulty = form.querySelector('.q.missing');
if (faulty) focusOn(faulty);
