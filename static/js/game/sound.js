// Short sounds by WebAudio; off until the participant turns them on, and silent before a gesture.

/** @import { BoardEvent } from '../board/events.js' */
/** @import { Catalogue } from '../browser/texts.js' */

import { local } from '../browser/storage.js';

/** @typedef {BoardEvent['kind'] | 'count' | 'over'} SoundKind */
/** @typedef {[frequencyHz: number, startS: number, lengthS: number]} Note */

const KEY = 'kitchenmind.sound';

/** @type {Partial<Record<SoundKind, Note[]>>} */
const TUNES = {
  taken: [[520, 0, 0.05]],
  put: [[340, 0, 0.06]],
  potted: [
    [300, 0, 0.05],
    [220, 0.05, 0.08],
  ],
  started: [
    [390, 0, 0.08],
    [520, 0.08, 0.1],
  ],
  ready: [
    [880, 0, 0.12],
    [1175, 0.12, 0.2],
  ],
  delivery: [
    [660, 0, 0.1],
    [830, 0.1, 0.1],
    [990, 0.2, 0.22],
  ],
  count: [[440, 0, 0.09]],
  over: [
    [520, 0, 0.15],
    [390, 0.16, 0.15],
    [260, 0.32, 0.3],
  ],
};

export class Sound {
  /**
   * @param {HTMLElement} button turns it on and off
   * @param {Catalogue} text
   */
  constructor(button, text) {
    this.button = button;
    this.text = text;
    /** @type {AudioContext | null} */
    this.context = null;
    this.on = local.getItem(KEY) === 'on';
    button.addEventListener('click', () => this.#toggle());
    this.#label();
  }

  /**
   * Play what happened; do nothing while off.
   * @param {SoundKind} kind
   */
  play(kind) {
    const tune = TUNES[kind];
    if (!this.on || !tune || !navigator.userActivation?.hasBeenActive) return;
    try {
      const context = (this.context ??= new AudioContext());
      for (const note of tune) playNote(context, note);
    } catch (error) {
      this.context = null; // without sound (no WebAudio, no free device) the game continues
      console.info('no sound:', error);
    }
  }

  #toggle() {
    this.on = !this.on;
    local.setItem(KEY, this.on ? 'on' : 'off');
    this.#label();
    this.play('ready');
  }

  #label() {
    this.button.setAttribute('aria-pressed', String(this.on));
    this.button.title = this.text(this.on ? 'sound.on' : 'sound.off');
  }
}

/**
 * @param {AudioContext} context
 * @param {Note} note
 */
function playNote(context, [frequency, startS, lengthS]) {
  const start = context.currentTime + startS;
  const tone = context.createOscillator();
  const volume = context.createGain();
  tone.type = 'triangle';
  tone.frequency.value = frequency;
  volume.gain.setValueAtTime(0.0001, start);
  volume.gain.exponentialRampToValueAtTime(0.12, start + 0.01);
  volume.gain.exponentialRampToValueAtTime(0.0001, start + lengthS);
  tone.connect(volume).connect(context.destination);
  tone.start(start);
  tone.stop(start + lengthS + 0.02);
}
