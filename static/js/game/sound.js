// Little beeps by WebAudio; off until the participant turns them on. No files, nothing before a gesture.

import { local } from '../browser/storage.js';

const KEY = 'kitchenmind.sound';

// kind -> notes [frequency in Hz, start in s, length in s]
const TUNES = {
  taken: [[520, 0, 0.05]], put: [[340, 0, 0.06]], potted: [[300, 0, 0.05], [220, 0.05, 0.08]], started: [[390, 0, 0.08], [520, 0.08, 0.1]],
  ready: [[880, 0, 0.12], [1175, 0.12, 0.2]], delivery: [[660, 0, 0.1], [830, 0.1, 0.1], [990, 0.2, 0.22]],
  count: [[440, 0, 0.09]], over: [[520, 0, 0.15], [390, 0.16, 0.15], [260, 0.32, 0.3]],
};

export class Sound {
  constructor(button, text) {
    Object.assign(this, { button, text, context: null });
    this.on = local.getItem(KEY) === 'on';
    button.addEventListener('click', () => this.#toggle());
    this.#label();
  }

  /** Plays what happened; does nothing while off. */
  play(kind) {
    if (!this.on || !TUNES[kind] || !navigator.userActivation?.hasBeenActive) return;
    this.context ??= new AudioContext();
    for (const [frequency, start, length] of TUNES[kind]) this.#note(frequency, this.context.currentTime + start, length);
  }

  #note(frequency, start, length) {
    const tone = this.context.createOscillator();
    const volume = this.context.createGain();
    tone.type = 'triangle';
    tone.frequency.value = frequency;
    volume.gain.setValueAtTime(0.0001, start);
    volume.gain.exponentialRampToValueAtTime(0.12, start + 0.01);
    volume.gain.exponentialRampToValueAtTime(0.0001, start + length);
    tone.connect(volume).connect(this.context.destination);
    tone.start(start);
    tone.stop(start + length + 0.02);
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
