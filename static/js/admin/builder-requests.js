// Sends a draft's texts to the server, with the token that every form needs; asks for a new token after a sign-in.

import { find } from '../browser/dom.js';
import { root } from '../browser/addresses.js';

/** @typedef {import('./builder-session.js').Operation} Operation */
/** @typedef {{ label: string, operation: Operation }} QuickFix a change that solves a problem */
/** @typedef {{ line: number, path: (string | number)[], text: string, warning: boolean, fix?: QuickFix }} Problem */
/** @typedef {{ text: string, values: any, problems: Problem[], refused: string,
 *   own: import('./builder-own-models.js').OwnModels }} View */
/** @typedef {{ status: number, body: any }} Answer */

const TOKEN = 'form_token';

export class DraftRequests {
  /** @param {number} draft */
  constructor(draft) {
    this.base = `${root}/admin/drafts/${draft}`;
    this.token = find(`#token [name=${TOKEN}]`, HTMLInputElement).value;
  }

  /**
   * Send fields to a route of the draft. `status` 0: the server cannot be reached.
   * @param {string} route
   * @param {Record<string, string>} fields
   * @returns {Promise<Answer>}
   */
  async post(route, fields) {
    let answer = await this.send(route, fields);
    if (answer.status === 403 && (await this.renewToken())) answer = await this.send(route, fields);
    return answer;
  }

  /**
   * @param {string} route
   * @param {Record<string, string>} fields
   * @returns {Promise<Answer>}
   */
  async send(route, fields) {
    const body = new URLSearchParams({ [TOKEN]: this.token, ...fields });
    try {
      const response = await fetch(`${this.base}/${route}`, {
        method: 'POST',
        body,
        headers: { Accept: 'application/json' },
      });
      return { status: response.status, body: await response.json() };
    } catch {
      return { status: 0, body: null };
    }
  }

  /**
   * Send fields without waiting for an answer, also when the page is being closed.
   * @param {string} route
   * @param {Record<string, string>} fields
   */
  sendLast(route, fields) {
    const body = new URLSearchParams({ [TOKEN]: this.token, ...fields });
    try {
      void fetch(`${this.base}/${route}`, { method: 'POST', body, keepalive: true }).catch(() => undefined);
    } catch {
      // Too long for a request that outlives its page. The text is in this browser's storage.
    }
  }

  /** Get a new token from a page of the current session; return whether there is one. */
  async renewToken() {
    try {
      const response = await fetch(this.base, { headers: { Accept: 'text/html' } });
      const page = new DOMParser().parseFromString(await response.text(), 'text/html');
      const field = page.querySelector(`#token [name=${TOKEN}]`);
      if (!(field instanceof HTMLInputElement)) return false;
      this.token = field.value;
      return true;
    } catch {
      return false;
    }
  }
}
