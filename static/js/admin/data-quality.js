// Fills in the proposals of the data-quality rules that were not ready when the table of games was sent.

import { root } from '../browser/addresses.js';
import { find, findAll } from '../browser/dom.js';
import { make } from './elements.js';

/** @typedef {'keep' | 'look' | 'drop'} Proposal */

const RETRY_MS = 300;
/** @type {Record<Proposal, string>} */
const FLAGS = { keep: 'ok', look: 'warn', drop: 'bad' };
const { study } = find('#games', HTMLElement).dataset;

async function fill() {
  const places = findAll('.quality[data-pending]', HTMLElement);
  if (!places.length) return;
  const answer = await fetch(`${root}/admin/s/${study}/quality.json`, { headers: { accept: 'application/json' } });
  if (!answer.ok) return;
  /** @type {{ waiting: number, proposals: Record<string, [proposal: Proposal, rules: string]> }} */
  const { waiting, proposals } = await answer.json();
  for (const place of places) {
    const found = proposals[place.dataset.episode ?? ''];
    if (!found) continue;
    const [proposal, rules] = found;
    const flag = make('span', { className: `flag ${FLAGS[proposal]}`, text: proposal });
    place.replaceChildren(flag, ' ', make('span', { className: 'soft', text: rules }));
    delete place.dataset.pending;
  }
  if (waiting) setTimeout(fill, RETRY_MS);
}

fill();
