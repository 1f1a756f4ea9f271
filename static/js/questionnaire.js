// A page of questions: keys 1-9 answer a scale, the first open question gets the focus, answers survive a reload of this tab.

const form = document.getElementById('questions');
const words = JSON.parse(form.dataset.words);
const draftKey = `answers:${form.dataset.step}`;
const fields = [...form.querySelectorAll('.q')];
const [alertBox, left, go] = ['alert', 'left', 'go'].map((id) => document.getElementById(id));

const fill = (key, numbers = {}) => words[key].replace(/\{(\w+)\}/g, (_, name) => numbers[name]);
const controls = (field) => [...field.querySelectorAll('input, textarea, select')];
const required = (field) => 'required' in field.dataset;

/** Whether a question has an answer that the server can take; what it means is checked there. */
function answered(field) {
  const all = controls(field);
  switch (field.dataset.type) {
    case 'scale': case 'choice': case 'multiple': return all.some((each) => each.checked);
    case 'ranking': return new Set(all.map((each) => each.value).filter(Boolean)).size === all.length;
    case 'number': return isNumber(all[0]);
    default: return all[0].value.trim() !== '';
  }
}

function isNumber(input) {
  const value = Number(input.value.trim().replace(',', '.'));
  return input.value.trim() !== '' && value >= Number(input.dataset.low) && value <= Number(input.dataset.high);
}

const begun = (field) => controls(field).some((each) => each.checked || (!/radio|checkbox/.test(each.type) && each.value.trim() !== ''));
const open = () => fields.filter((field) => (required(field) || begun(field)) && !answered(field));

function tell() {
  left.textContent = fill('answered', { done: fields.filter(answered).length, count: fields.length });
}

function markFields(missing) {
  for (const field of fields) {
    const wrong = missing.includes(field);
    field.classList.toggle('missing', wrong);
    for (const each of controls(field)) wrong ? each.setAttribute('aria-invalid', 'true') : each.removeAttribute('aria-invalid');
  }
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
  sessionStorage.setItem(draftKey, JSON.stringify(draft));
}

/** Puts a draft of this tab back, unless the server has sent the answers with the page. */
function restore() {
  const draft = JSON.parse(sessionStorage.getItem(draftKey) ?? '[]');
  if (fields.some(begun)) return;
  for (const [name, value] of draft) {
    for (const each of form.elements) {
      if (each.name !== name) continue;
      if (/radio|checkbox/.test(each.type)) each.checked ||= each.value === value;
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

/** A digit answers the scale in focus, or the first open one, and moves on. */
function digit(event) {
  if (!/^[1-9]$/.test(event.key) || event.ctrlKey || event.metaKey || event.altKey) return;
  if (/^(text|number|textarea|select-one)$/.test(document.activeElement?.type)) return;
  const field = document.activeElement?.closest('.q') ?? fields.find((each) => !answered(each));
  const radio = field?.dataset.type === 'scale' ? controls(field)[Number(event.key) - 1] : null;
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
