// The text of a draft, changed from the form or as YAML. The server applies changes of the form and checks the text.

/** @typedef {import('./builder-requests.js').DraftRequests} DraftRequests */
/** @typedef {import('./builder-requests.js').View} View */
/** @typedef {(string | number)[]} Path */
/** @typedef {{ do: 'put', path: Path, value: any, plain?: boolean } | { do: 'remove', path: Path }
 *   | { do: 'insert', path: Path, index: number, value: any } | { do: 'move', path: Path, index: number, to: number }
 *   | { do: 'rename', path: Path, key: string } | { do: 'keep', path: Path, items: number[] }} Operation */

const LOOK_AFTER_MS = 250; // of no typing in the YAML
const RETRY_MS = 1500;
const MAX_UNDONE = 200;
const NEVER = new Set([400, 413, 422, 500]); // answers that a second try does not change

export class DraftSession {
  /**
   * @param {DraftRequests} requests
   * @param {string} text
   * @param {{ text(text: string): void, view(view: View): void, refused(words: string): void }} on
   */
  constructor(requests, text, on) {
    this.requests = requests;
    this.text = text;
    this.on = on;
    /** @type {Operation[]} */
    this.operations = [];
    /** @type {string[]} */
    this.before = [];
    this.mustLook = true;
    this.isBusy = false;
    this.timer = 0;
  }

  /**
   * Change a value from the form. A newer value of the same field replaces one that still waits.
   * @param {Operation} operation
   */
  change(operation) {
    const last = this.operations.at(-1);
    const isNewer = last?.do === 'put' && operation.do === 'put' && String(last.path) === String(operation.path);
    const isWaiting = isNewer && !(this.isBusy && this.operations.length === 1);
    if (isWaiting) this.operations[this.operations.length - 1] = operation;
    else this.operations.push(operation);
    void this.work();
  }

  /**
   * Take the text as it was typed.
   * @param {string} text
   */
  typed(text) {
    if (text === this.text) return;
    this.remember();
    this.text = text;
    this.on.text(text);
    this.mustLook = true;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.work(), LOOK_AFTER_MS);
  }

  /**
   * Take a text that has changes of others. It cannot be undone: an earlier text would undo their changes, too.
   * @param {string} text
   */
  adopt(text) {
    this.before = [];
    this.text = text;
    this.on.text(text);
    this.look();
  }

  remember() {
    if (this.before.at(-1) !== this.text) this.before.push(this.text);
    if (this.before.length > MAX_UNDONE) this.before.shift();
  }

  /** Go back to the text before the last change. */
  undo() {
    const text = this.before.pop();
    if (text === undefined) return;
    this.operations = [];
    this.text = text;
    this.on.text(text);
    this.mustLook = true;
    void this.work();
  }

  /** Check the text once more. */
  look() {
    this.mustLook = true;
    void this.work();
  }

  /** Whether a field has a value that is not yet in the text.
   * @param {Path} path */
  waits(path) {
    return this.operations.some((one) => String(one.path) === String(path));
  }

  async work() {
    if (this.isBusy) return;
    this.isBusy = true;
    while (this.operations.length > 0 || this.mustLook) {
      const operation = this.operations[0];
      const from = this.text;
      this.mustLook = false;
      const fields = { text: from, operation: operation ? JSON.stringify(operation) : '' };
      const { status, body } = await this.requests.post('look', fields);
      if (status !== 200) {
        this.mustLook = true;
        this.on.refused(body?.detail ?? 'No connection: your last change is not saved yet. Keep this page open.');
        if (operation && NEVER.has(status)) this.operations.shift();
        await new Promise((done) => setTimeout(done, RETRY_MS));
      } else this.take(body, from, operation);
    }
    this.isBusy = false;
  }

  /**
   * @param {View} view
   * @param {string} from
   * @param {Operation | undefined} operation
   */
  take(view, from, operation) {
    if (this.text !== from) {
      this.mustLook = true; // typed in the meantime: apply the change to that text
      return;
    }
    if (operation && this.operations[0] === operation) this.operations.shift();
    this.on.refused(view.refused);
    if (view.text !== from) {
      this.remember();
      this.text = view.text;
      this.on.text(view.text);
    }
    this.on.view(view);
  }
}
