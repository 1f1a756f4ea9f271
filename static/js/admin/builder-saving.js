// Saves a draft while it is written: every text goes into this browser's storage at once and to the server soon after.

import { local, readJson } from '../browser/storage.js';

/** @typedef {import('./builder-requests.js').DraftRequests} DraftRequests */
/** @typedef {{ theirs: string, mine: string }} Contradiction a place that two people changed in two ways */
/** @typedef {{ revision: number, text: string, author: string, parts?: (string | Contradiction)[] }} Theirs */
/** @typedef {{ revision: number, text: string, base?: string, sent?: string }} Kept */

const AFTER_MS = 600; // of no typing
const MAX_DELAY_MS = 1500; // however much is typed
const RETRY_MS = 2000;
const TAKE_IN_AFTER_MS = 200;
const MAX_LAST = 60_000; // bytes that a request may send after its page was closed
export const SAVING = 'Saving …';
const WITH_OTHERS = 'Saved, with changes that somebody else has made';

export class DraftSaving {
  /**
   * @param {DraftRequests} requests
   * @param {{ id: number, revision: number, source: string, author: string }} about
   * @param {{ state(words: string, isGood: boolean): void, conflict(theirs: Theirs): void,
   *   saved(revision: number): void, isBusy(): boolean, merged(text: string): void }} on `isBusy`: a change of the form
   *   is not in the text yet; `merged`: show a text that also has the changes of others
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
   * Return the unsaved text of an earlier visit from this browser's storage; null if there is none.
   * @returns {Kept | null}
   */
  kept() {
    const found = readJson(local, this.key, null);
    const isWhole = typeof found?.text === 'string' && Number.isInteger(found?.revision);
    if (!isWhole || found.text === this.savedText) return null;
    const isOurs = found.sent === this.savedText; // saved, and the answer came after the page was closed
    return isOurs ? { text: found.text, revision: this.revision } : found;
  }

  /**
   * Continue with the text from this browser's storage, which is based on an earlier text than the server's.
   * @param {Kept} kept with its base
   */
  goOnFrom(kept) {
    this.revision = kept.revision;
    this.savedText = kept.base ?? '';
    this.sent = kept.sent ?? this.savedText;
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
    this.on.state(SAVING, true);
    this.waitingSinceMs ||= performance.now();
    const left = MAX_DELAY_MS - (performance.now() - this.waitingSinceMs);
    this.schedule(Math.max(0, Math.min(AFTER_MS, left)));
  }

  keep() {
    const kept = { revision: this.revision, text: this.text, sent: this.sent, base: this.savedText };
    local.setItem(this.key, JSON.stringify(kept));
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
    /** @type {Record<string, string>} */
    const fields = { text: sent, revision: String(this.revision), note, base: this.savedText };
    if (before !== this.savedText) fields.before = before; // its answer was lost, so the server may have it
    const { status, body } = await this.requests.post('save', fields);
    this.isSending = false;
    if (status === 200 && body.text !== sent) this.isMerged(sent, body);
    else if (status === 200) this.isSaved(sent, body.revision);
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

  /**
   * Handle the answer that the server has merged the sent text with changes of others.
   * @param {string} sent
   * @param {{ revision: number, text: string }} theirs
   */
  isMerged(sent, theirs) {
    this.savedText = sent; // both have it: the next text is merged on top of it
    if (this.text !== sent) this.put(this.text);
    else if (this.on.isBusy()) this.timer = setTimeout(() => this.isMerged(sent, theirs), TAKE_IN_AFTER_MS);
    else {
      this.text = theirs.text;
      this.sent = theirs.text;
      this.isSaved(theirs.text, theirs.revision);
      this.on.merged(theirs.text);
      this.on.state(WITH_OTHERS, true);
    }
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
      status === 401
        ? 'Not saved: you are signed out. Sign in in another tab; this page then continues.'
        : status === 0
          ? 'Not saved: no connection. The text is kept in this browser.'
          : `Not saved: ${(body?.detail ?? 'the server failed').replace(/\.$/, '')}. The text is kept in this browser.`;
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
    this.sent = theirs.text;
    this.text = text;
    if (text === theirs.text) this.isSaved(text, theirs.revision);
    else await this.save('merged');
  }

  leave() {
    if (this.isStopped || this.text === this.savedText) return;
    const fields = { text: this.text, revision: String(this.revision), note: 'edited' };
    const whole = { ...fields, base: this.savedText };
    this.requests.sendLast('save', new URLSearchParams(whole).toString().length < MAX_LAST ? whole : fields);
  }
}
