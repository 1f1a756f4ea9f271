// Saves a draft while it is written: every text goes into this browser's storage at once and to the server soon after.

import { local, readJson } from '../browser/storage.js';

/** @typedef {import('./builder-requests.js').DraftRequests} DraftRequests */
/** @typedef {{ revision: number, text: string, author: string }} Theirs */
/** @typedef {{ revision: number, text: string }} Kept */

const AFTER_MS = 600; // of no typing
const AT_MOST_MS = 1500; // however much is typed
const RETRY_MS = 2000;

export class DraftSaving {
  /**
   * @param {DraftRequests} requests
   * @param {{ id: number, revision: number, source: string, author: string }} about
   * @param {{ state(words: string, isGood: boolean): void, conflict(theirs: Theirs): void,
   *   saved(revision: number): void }} on
   */
  constructor(requests, about, on) {
    this.requests = requests;
    this.on = on;
    this.key = `draft ${about.id} ${about.author}`;
    this.revision = about.revision;
    this.savedText = about.source;
    this.text = about.source;
    this.sent = about.source; // last
    this.isStopped = false; // by a conflict
    this.isSending = false;
    this.timer = 0;
    this.waitingSinceMs = 0;
    addEventListener('pagehide', () => this.leave());
  }

  /**
   * What this browser kept of an earlier visit and could not save; null if there is nothing.
   * @returns {Kept | null}
   */
  kept() {
    const found = readJson(local, this.key, null);
    const isWhole = typeof found?.text === 'string' && Number.isInteger(found?.revision);
    if (!isWhole || found.text === this.savedText) return null;
    const isOurs = found.sent === this.savedText; // saved, and the answer came after the page was closed
    return { text: found.text, revision: isOurs ? this.revision : found.revision };
  }

  /**
   * Keep a text at once, and save it soon.
   * @param {string} text
   */
  put(text) {
    this.text = text;
    if (text === this.savedText && !this.isSending && !this.isStopped) {
      clearTimeout(this.timer);
      local.removeItem(this.key);
      this.on.state('Saved', true);
      return;
    }
    this.keep();
    if (this.isStopped) return;
    this.on.state('Saving …', true);
    this.waitingSinceMs ||= performance.now();
    const left = AT_MOST_MS - (performance.now() - this.waitingSinceMs);
    this.schedule(Math.max(0, Math.min(AFTER_MS, left)));
  }

  keep() {
    local.setItem(this.key, JSON.stringify({ revision: this.revision, text: this.text, sent: this.sent }));
  }

  /** @param {number} ms */
  schedule(ms) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.save(), ms);
  }

  /** @param {string} note how the text came about */
  async save(note = 'edited') {
    if (this.isSending || (this.text === this.savedText && note === 'edited')) return;
    clearTimeout(this.timer);
    this.isSending = true;
    this.waitingSinceMs = 0;
    const sent = this.text;
    const before = this.sent;
    this.sent = sent;
    this.keep();
    const fields = { text: sent, revision: String(this.revision), note };
    const { status, body } = await this.requests.post('save', fields);
    this.isSending = false;
    if (status === 200) this.isSaved(sent, body.revision);
    else if (status === 409 && body.text === before)
      this.isSaved(before, body.revision); // its answer was lost
    else if (status === 409) this.stop(body);
    else this.failed(status, body);
  }

  /**
   * @param {string} sent
   * @param {number} revision
   */
  isSaved(sent, revision) {
    this.revision = revision;
    this.savedText = sent;
    this.on.saved(revision);
    if (this.text === sent) {
      local.removeItem(this.key);
      this.on.state('Saved', true);
    } else this.put(this.text);
  }

  /** @param {Theirs} theirs */
  stop(theirs) {
    this.isStopped = true;
    clearTimeout(this.timer);
    this.on.state('Not saved: somebody else has changed this draft', false);
    this.on.conflict(theirs);
  }

  /**
   * @param {number} status
   * @param {any} body
   */
  failed(status, body) {
    const words =
      status === 401 || status === 403
        ? 'Not saved: you are signed out. Sign in in another tab; this page then continues.'
        : status === 0
          ? 'Not saved: no connection. The text is kept in this browser.'
          : `Not saved: ${body?.detail ?? 'the server failed'}. The text is kept in this browser.`;
    this.on.state(words, false);
    this.schedule(RETRY_MS);
  }

  /**
   * Continue after a conflict, on top of what the others have saved.
   * @param {Theirs} theirs
   * @param {string} text
   */
  async resolve(theirs, text) {
    this.isStopped = false;
    this.revision = theirs.revision;
    this.savedText = theirs.text;
    this.text = text;
    if (text === theirs.text) this.isSaved(text, theirs.revision);
    else await this.save('merged');
  }

  leave() {
    if (this.isStopped || this.text === this.savedText) return;
    this.requests.sendLast('save', { text: this.text, revision: String(this.revision), note: 'edited' });
  }
}
