// localStorage and sessionStorage that never throw. If the browser stores nothing, values live as long as the page.

class SafeStorage {
  /** @param {'localStorage' | 'sessionStorage'} name */
  constructor(name) {
    this.name = name;
    /** @type {Map<string, string>} */
    this.memory = new Map();
  }

  /**
   * @param {string} key
   * @returns {string | null}
   */
  getItem(key) {
    try {
      return window[this.name].getItem(key) ?? this.memory.get(key) ?? null;
    } catch {
      return this.memory.get(key) ?? null;
    }
  }

  /**
   * @param {string} key
   * @param {string | number} value
   */
  setItem(key, value) {
    try {
      window[this.name].setItem(key, String(value));
    } catch {
      this.memory.set(key, String(value));
    }
  }

  /** @param {string} key */
  removeItem(key) {
    this.memory.delete(key);
    try {
      window[this.name].removeItem(key);
    } catch {
      // Nothing was stored there.
    }
  }
}

export const local = new SafeStorage('localStorage');
export const session = new SafeStorage('sessionStorage');

/**
 * Return the JSON stored under a key, or `otherwise` if there is none or it cannot be read.
 * @param {Pick<Storage, 'getItem'>} storage
 * @param {string} key
 * @param {any} otherwise
 * @returns {any} the value may come from an older version of the page or from the participant: check it
 */
export function readJson(storage, key, otherwise) {
  try {
    return JSON.parse(storage.getItem(key) ?? 'null') ?? otherwise;
  } catch {
    return otherwise;
  }
}
