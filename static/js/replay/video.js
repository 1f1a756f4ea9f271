// The picture and the video of a replay, made in this browser, quicker than it plays. Knows the canvas and the record.

import { Renderer } from '../board/renderer.js';
import { webm } from './webm.js';
import { Sprites } from '../board/sprites.js';
import { apply, defaults } from '../board/state.js';

const PARTS = 5; // pictures a timestep
const WIDTH = 960, HEIGHT = 640, CAPTION = 40; // at most, in CSS pixels
const KEY_EVERY = 50; // pictures
const MOST_WAITING = 6; // pictures at the encoder
const BITS_A_SECOND = 1_000_000;
const CODECS = [['vp09.00.31.08', 'V_VP9'], ['vp8', 'V_VP8']];

/** Whether this browser can make a video (over https or on one's own machine). */
export const canFilm = 'VideoEncoder' in window;

export class Film {
  /** `who`: the tag over the own chef. */
  constructor(canvas, name, who) {
    Object.assign(this, { canvas, name, who, running: null });
  }

  picture(t) {
    this.canvas.toBlob((blob) => save(blob, `${this.name}-t${t}.png`), 'image/png');
  }

  /** Makes a video of the record from timestep `first` on and saves it; pressed again, it saves what there is. */
  async record(button, record, first) {
    if (this.running) { this.running.stopped = true; return; }
    const words = button.textContent;
    const running = this.running = { stopped: false };
    try {
      const stage = await Stage.made(record, this.who);
      const last = record.rows.length - 1;
      for (let t = first < last ? first : 0; t <= last && !running.stopped; t += 1) {
        await stage.play(t);
        button.textContent = `${Math.round(100 * t / last)} %, stop`;
      }
      save(await stage.film(), `${this.name}.webm`);
    } finally {
      button.textContent = words;
      this.running = null;
    }
  }
}

/** Draws timestep after timestep on a canvas of its own and encodes what is on it. */
class Stage {
  static async made(record, who) {
    const stage = new Stage();
    const sprites = new Sprites('/static/sprites/');
    await sprites.load();
    const board = document.createElement('canvas');
    stage.renderer = new Renderer(board, sprites, who);
    stage.renderer.fit(record.game.grid, WIDTH / devicePixelRatio, HEIGHT / devicePixelRatio);
    const canvas = document.createElement('canvas');
    canvas.width = board.width + board.width % 2;
    canvas.height = board.height + CAPTION + board.height % 2;
    Object.assign(stage, { record, who, board, canvas, pen: canvas.getContext('2d'), state: null, nowMs: 0, count: 0, pictures: [], fault: null });
    await stage.#open();
    return stage;
  }

  async #open() {
    const size = { width: this.canvas.width, height: this.canvas.height, bitrate: BITS_A_SECOND };
    for (const [codec, name] of CODECS) {
      if (!(await VideoEncoder.isConfigSupported({ ...size, codec })).supported) continue;
      this.codec = name;
      this.encoder = new VideoEncoder({ output: (chunk) => this.#keep(chunk), error: (fault) => { this.fault = fault; } });
      this.encoder.configure({ ...size, codec });
      return;
    }
    throw new Error('this browser encodes neither VP9 nor VP8');
  }

  #keep(chunk) {
    const data = new Uint8Array(chunk.byteLength);
    chunk.copyTo(data);
    this.pictures.push({ data, ms: Math.round(chunk.timestamp / 1000), key: chunk.type === 'key' });
  }

  /** One timestep, as it was on the participant's screen. */
  async play(t) {
    const { rows, game } = this.record;
    const { state, displayed, actions, late } = rows[t];
    const isFirst = this.state === null;
    this.state ??= apply(defaults(), { type: 'welcome', ...game, state, endless: !game.horizon }, this.nowMs);
    this.state = apply({ ...this.state, phase: 'playing' }, { type: 'tick', state, prediction: displayed, actions: actions ?? [4, 4], applied: -1, late }, this.nowMs);
    if (!isFirst) this.renderer.took(this.state, this.nowMs);
    for (let part = 0; part < PARTS; part += 1) {
      this.renderer.draw(this.state, this.nowMs, false);
      this.#caption(t, state.score);
      await this.#encode(game.tick_ms / PARTS);
      this.nowMs += game.tick_ms / PARTS;
    }
  }

  #caption(t, score) {
    const { pen, canvas, board } = this;
    pen.fillStyle = '#fff';
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(board, 0, 0);
    pen.fillStyle = '#22303c';
    pen.font = '600 18px system-ui, sans-serif';
    pen.textBaseline = 'middle';
    pen.fillText(`${this.who} · ${this.record.game.title} · t ${t} · score ${score}`, 12, board.height + CAPTION / 2, canvas.width - 24);
  }

  async #encode(lengthMs) {
    const picture = new VideoFrame(this.canvas, { timestamp: Math.round(1000 * this.nowMs), duration: Math.round(1000 * lengthMs) });
    this.encoder.encode(picture, { keyFrame: this.count % KEY_EVERY === 0 });
    picture.close();
    this.count += 1;
    while (this.encoder.encodeQueueSize > MOST_WAITING && !this.fault) await new Promise((go) => { setTimeout(go, 5); });
    if (this.fault) throw this.fault;
  }

  async film() {
    await this.encoder.flush();
    this.encoder.close();
    return webm({ codec: this.codec, width: this.canvas.width, height: this.canvas.height, ms: this.nowMs }, this.pictures);
  }
}

function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
