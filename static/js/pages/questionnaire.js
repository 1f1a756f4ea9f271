// A page of questions: keys 1-9 answer a scale, the first open question gets the focus, answers survive a reload of this tab.

import { readNumber } from './read-number.js';
import { readJson, session } from '../browser/storage.js';

const form = document.getElementById('questions');
const words = JSON.parse(form.dataset.words), reasons = JSON.parse(form.dataset.faults);
const draftKey = `answers:${form.dataset.step}`;
const fields = [...form.querySelectorAll('.q')];
const [alertBox, left, go] = ['alert', 'left', 'go'].map((id) => document.getElementById(id));

const CONTROL = /[\u0000-\u0008\u000b\u000c\u000e-\u001f\u007f-\u009f]/; // as in server/study/questionnaire.py

const fillIn = (text, values) => text.replace(/\{(\w+)\}/g, (_, name) => values[name]);
const fill = (key, numbers = {}) => fillIn(words[key], numbers);
const controls = (field) => [...field.querySelectorAll('input, textarea, select')];
const required = (field) => 'required' in field.dataset;

/** Whether a question has an answer that the server can take; what it means is checked there. */
function answered(field) {
  const all = controls(field);
  switch (field.dataset.type) {
    case 'scale': case 'choice': case 'multiple': return all.some((each) => each.checked);
    case 'ranking': return new Set(all.map((each) => each.value).filter(Boolean)).size === all.length;
    default: return all[0].value.trim() !== '' && written(field) === null;
  }
}

/** Why what is written in a field cannot be taken: {reason, ...values}, a key of the words' `faults`; null if it can. */
function written(field) {
  const [input] = controls(field);
  if (field.dataset.type === 'number') return numberFault(input);
  const found = input.value.match(CONTROL);
  return found && { reason: 'control', before: input.value.slice(Math.max(0, found.index - 20), found.index) };
}

function numberFault(input) {
  const { low, high, whole } = input.dataset;
  const { value, reason } = readNumber(input.value);
  if (reason) return reason === 'missing_number' ? { reason, ...range(input) } : { reason, given: input.value.trim() };
  if (!(value >= Number(low) && value <= Number(high))) return { reason: 'missing_number', ...range(input) };
  return whole !== undefined && value % 1 !== 0 ? { reason: 'whole' } : null;
}

const range = ({ dataset: { low, high } }) => ({ low: Number(low), high: Number(high) });

const begun = (field) => controls(field).some((each) => each.checked || (!/radio|checkbox/.test(each.type) && each.value.trim() !== ''));
const open = () => fields.filter((field) => (required(field) || begun(field)) && !answered(field));

function tell() {
  left.textContent = fill('answered', { done: fields.filter(answered).length, count: fields.length });
}

function markFields(missing) {
  for (const field of fields) {
    const wrong = missing.includes(field);
    if (wrong) explain(field);
    field.classList.toggle('missing', wrong);
    for (const each of controls(field)) wrong ? each.setAttribute('aria-invalid', 'true') : each.removeAttribute('aria-invalid');
  }
}

/** Says below a field with something written in it what is the matter with that. */
function explain(field) {
  const [input] = controls(field), message = field.querySelector('.msg');
  if (!/^(text|number)$/.test(field.dataset.type)) return;
  const fault = input.value.trim() === '' ? null : written(field);
  message.textContent = fault ? fillIn(reasons[fault.reason], fault) : message.dataset.usual;
  if (fault && fault.reason === 'control') selectControl(input);
}

/** Shows where the character is that cannot be seen. */
function selectControl(input) {
  const { index } = input.value.match(CONTROL);
  setTimeout(() => input.setSelectionRange(index, index + 1)); // after the focus has come
}

function summary(missing) {
  const bold = Object.assign(document.createElement('b'), { textContent: fill(missing.length === 1 ? 'open_one' : 'open_many', { count: missing.length }) });
  const links = missing.flatMap((field, k) => [k ? ', ' : ' ', Object.assign(document.createElement('a'), {
    href: `#${field.id}`, textContent: fill('question', { number: fields.indexOf(field) + 1 }),
  })]);
  alertBox.querySelector('p').replaceChildren(bold, ...links);
  alertBox.hidden = missing.length === 0;
}

function focusOn(field) {
  const first = controls(field).find((each) => each.checked) ?? controls(field)[0];
  first.focus();
}

function save() {
  const draft = [...new FormData(form)].filter(([name]) => !['step', 'attempt', 'form_token'].includes(name));
  session.setItem(draftKey, JSON.stringify(draft));
}

/** Puts a draft of this tab back, unless the server has sent the answers with the page. */
function restore() {
  const draft = readJson(session, draftKey, []);
  if (fields.some(begun)) return;
  for (const [name, value] of draft) {
    for (const each of form.elements) {
      if (each.name !== name) continue;
      if (/radio|checkbox/.test(each.type)) each.checked = each.checked || each.value === value;
      else each.value = value;
    }
  }
}

function changed(event) {
  const field = event.target.closest('.q');
  if (!field) return;
  if (answered(field)) {
    field.classList.remove('missing');
    controls(field).forEach((each) => each.removeAttribute('aria-invalid'));
  }
  if (!alertBox.hidden && !form.querySelector('.missing')) alertBox.hidden = true;
  save();
  tell();
}

/** The digit 1-9 that a key writes, also where a keyboard wants Shift for digits or writes those of another script; 0: none. */
function digitOf(event) {
  if (/^[1-9]$/.test(event.key)) return Number(event.key);
  const place = /^Digit([1-9])$/.exec(event.code);
  return place && !event.shiftKey ? Number(place[1]) : 0;
}

/** A digit answers the scale in focus, or else the first open one, and moves on. */
function digit(event) {
  const number = digitOf(event);
  if (!number || event.repeat || event.ctrlKey || event.metaKey || event.altKey || event.isComposing) return;
  if (/^(text|number|textarea|select-one)$/.test(document.activeElement?.type)) return;
  const isScale = (field) => field?.dataset.type === 'scale';
  const here = document.activeElement?.closest('.q');
  const field = isScale(here) ? here : fields.find((each) => isScale(each) && !answered(each));
  const radio = field && controls(field)[number - 1];
  if (!radio) return;
  event.preventDefault();
  radio.checked = true;
  radio.dispatchEvent(new Event('change', { bubbles: true }));
  const next = fields[fields.indexOf(field) + 1];
  next ? focusOn(next) : go.focus();
}

function submitted(event) {
  const missing = open();
  markFields(missing);
  summary(missing);
  if (missing.length === 0) { go.disabled = true; return; }
  event.preventDefault();
  focusOn(missing[0]);
}

form.noValidate = true;
restore();
tell();
form.addEventListener('input', changed);
form.addEventListener('change', changed);
form.addEventListener('submit', submitted);
document.addEventListener('keydown', digit);
// Back from the browser's cache the button must work again.
addEventListener('pageshow', () => { go.disabled = false; });
alertBox.addEventListener('click', (event) => {
  const field = fields.find((each) => `#${each.id}` === event.target.getAttribute('href'));
  if (field) { event.preventDefault(); focusOn(field); }
});
const faulty = form.querySelector('.q.missing');
if (faulty) focusOn(faulty);
