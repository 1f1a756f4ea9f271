// Errors of this page go to the researcher's list of problems: each once, a few at most.

import { trouble } from './messages.js';

const MOST = 5;

/** Reports errors through `send(message)`; returns `report(error)` for errors that are caught. */
export function reportTrouble(send) {
  const seen = new Set();
  const report = (problem) => {
    const words = String(problem?.stack ?? problem?.message ?? problem).slice(0, 500);
    if (seen.has(words) || seen.size >= MOST) return;
    seen.add(words);
    if (!send(trouble(words))) seen.delete(words);
  };
  window.addEventListener('error', (event) => report(event.error ?? `${event.message} (${event.filename}:${event.lineno})`));
  window.addEventListener('unhandledrejection', (event) => report(event.reason));
  return report;
}
