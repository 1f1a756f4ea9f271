// localStorage and sessionStorage that never throw. Where the browser keeps nothing, values live as long as the page.

class Kept {
  constructor(name) {
    this.name = name;
    this.memory = new Map();
  }

  getItem(key) {
    try {
      return window[this.name].getItem(key) ?? this.memory.get(key) ?? null;
    } catch {
      return this.memory.get(key) ?? null;
    }
  }

  setItem(key, value) {
    try {
      window[this.name].setItem(key, value);
    } catch {
      this.memory.set(key, String(value));
    }
  }

  removeItem(key) {
    this.memory.delete(key);
    try {
      window[this.name].removeItem(key);
    } catch {
      // Nothing was kept there.
    }
  }
}

export const local = new Kept('localStorage');
export const session = new Kept('sessionStorage');

/** The JSON stored under a key; `otherwise` where there is none or it cannot be read. */
export function readJson(storage, key, otherwise) {
  try {
    return JSON.parse(storage.getItem(key)) ?? otherwise;
  } catch {
    return otherwise;
  }
}
