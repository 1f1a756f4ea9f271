// Fills in the proposals of the quality rules that were not ready when the table of games was sent.

import { make } from './admin-page.js';

const AGAIN_MS = 300;
const FLAGS = { keep: 'ok', look: 'warn', drop: 'bad' };
const { study } = document.querySelector('#games').dataset;
const waits = () => [...document.querySelectorAll('.verdict[data-waits]')];

async function fill() {
  if (!waits().length) return;
  const answer = await fetch(`/admin/s/${study}/verdicts.json`, { headers: { accept: 'application/json' } });
  if (!answer.ok) return;
  const { waiting, verdicts } = await answer.json();
  for (const place of waits()) {
    const said = verdicts[place.dataset.episode];
    if (!said) continue;
    const [proposal, rules] = said;
    place.replaceChildren(make('span', { className: `flag ${FLAGS[proposal]}`, text: proposal }), ' ', make('span', { className: 'soft', text: rules }));
    delete place.dataset.waits;
  }
  if (waiting) setTimeout(fill, AGAIN_MS);
}

fill();
