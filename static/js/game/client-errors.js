// Reports errors of this page to the researcher's list of errors: each once, and a few at most.

import { clientError } from './messages.js';

const MAX_REPORTS = 5;

/**
 * Report errors that nobody catches. Returns `report(error)` for those that are caught.
 * @param {(message: Wire.ClientError) => boolean} send false if the message could not be sent
 * @returns {(problem: unknown) => void}
 */
export function reportClientErrors(send) {
  /** @type {Set<string>} */
  const seen = new Set();
  /** @param {unknown} problem */
  const report = (problem) => {
    const text = String((problem instanceof Error && (problem.stack ?? problem.message)) || problem).slice(0, 500);
    if (seen.has(text) || seen.size >= MAX_REPORTS) return;
    seen.add(text);
    if (!send(clientError(text))) seen.delete(text);
  };
  window.addEventListener('error', (event) => {
    report(event.error ?? `${event.message} (${event.filename}:${event.lineno})`);
  });
  window.addEventListener('unhandledrejection', (event) => report(event.reason));
  return report;
}
