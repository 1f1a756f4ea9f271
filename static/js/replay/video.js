// Makes the picture and the video of a replay in this browser, faster than the game is played.

/** @import { Catalogue } from '../browser/texts.js' */
/** @import { State } from '../board/state.js' */
/** @import { EncodedFrame, Film } from './webm.js' */

import { Renderer, pixelRatio } from '../board/renderer.js';
import { Sprites } from '../board/sprites.js';
import { apply } from '../board/state.js';
import { boardState } from '../board/still-board.js';
import { SPRITES } from '../browser/addresses.js';
import { context2d } from '../browser/dom.js';
import { frameOf } from './details.js';
import { webm } from './webm.js';

const FRAMES_PER_TICK = 5;
/** @typedef {[width: number, height: number]} Size at most, in pixels */
/** @type {Size} */
const VIDEO_SIZE = [960, 640];
/** @type {Size} large enough for print */
const PICTURE_SIZE = [1920, 1440];
const CAPTION = 40;
const KEY_FRAME_EVERY = 50;
const MAX_QUEUED = 6; // frames at the encoder
const BITS_PER_SECOND = 1_000_000;
/** @type {[codec: string, name: Film['codec']][]} */
const CODECS = [
  ['vp09.00.31.08', 'V_VP9'],
  ['vp8', 'V_VP8'],
];

/** Whether this browser can make a video (over https or on one's own machine). */
export const canRecordVideo = 'VideoEncoder' in window;
export const noVideoWords = isSecureContext
  ? 'This browser cannot make videos. Use a newer Chrome, Edge, Firefox or Safari.'
  : 'Browsers make videos on https addresses only. Open this page over https, or on the server’s own machine.';

export class VideoExport {
  /**
   * @param {string} name of the files, without ending
   * @param {string} who the tag over the own chef
   * @param {Catalogue} text the words of bubbles
   */
  constructor(name, who, text) {
    this.name = name;
    this.who = who;
    this.text = text;
    /** @type {{ stopped: boolean } | null} */
    this.running = null;
  }

  /**
   * Draw one timestep on a large board and save it.
   * @param {Researcher.EpisodeRecord} record
   * @param {number} t
   */
  async picture(record, t) {
    const board = document.createElement('canvas');
    const renderer = await rendererOf(board, record, this.who, PICTURE_SIZE);
    renderer.text = this.text;
    const row = record.rows[t];
    const still = boardState(record.game, row.state, 0);
    renderer.draw(apply(still, frameOf(row), 0), 0, true);
    board.toBlob((blob) => {
      if (blob) save(blob, `${this.name}-t${t}.png`);
    }, 'image/png');
  }

  /**
   * Make a video of the record and save it. A second press of the button saves the part so far.
   * @param {HTMLElement} button
   * @param {Researcher.EpisodeRecord} record
   * @param {number} first timestep
   */
  async record(button, record, first) {
    if (this.running) {
      this.running.stopped = true;
      return;
    }
    const words = button.textContent;
    const running = { stopped: false };
    this.running = running;
    try {
      const recorder = await VideoRecorder.open(record, this.who);
      recorder.renderer.text = this.text;
      const last = record.rows.length - 1;
      for (let t = first < last ? first : 0; t <= last && !running.stopped; t += 1) {
        await recorder.add(t);
        button.textContent = `${Math.round((100 * t) / last)} %, stop`;
      }
      save(await recorder.finish(), `${this.name}.webm`);
    } finally {
      button.textContent = words;
      this.running = null;
    }
  }
}

/**
 * Return a renderer whose board has about this size.
 * @param {HTMLCanvasElement} board
 * @param {Researcher.EpisodeRecord} record
 * @param {string} who the tag over the own chef
 * @param {Size} size
 */
async function rendererOf(board, record, who, [width, height]) {
  const renderer = new Renderer(board, await new Sprites(SPRITES).load(), who);
  renderer.greysOldMarks = false;
  renderer.outlinesView = true;
  renderer.fit(record.game.grid, width / pixelRatio(), height / pixelRatio());
  return renderer;
}

/** Draws one timestep after another on a canvas of its own and encodes what is on it. */
class VideoRecorder {
  /**
   * @param {Researcher.EpisodeRecord} record
   * @param {string} who
   * @param {HTMLCanvasElement} board
   * @param {Renderer} renderer draws on the board
   */
  constructor(record, who, board, renderer) {
    this.gameRecord = record;
    this.who = who;
    this.board = board;
    this.renderer = renderer;
    this.canvas = document.createElement('canvas');
    this.canvas.width = this.board.width + (this.board.width % 2); // encoders want even sides
    this.canvas.height = this.board.height + CAPTION + (this.board.height % 2);
    this.context = context2d(this.canvas);
    /** @type {State | null} */
    this.state = null;
    this.nowMs = 0;
    this.count = 0;
    /** @type {EncodedFrame[]} */
    this.frames = [];
    /** @type {DOMException | null} */
    this.fault = null;
    /** @type {Film['codec']} */
    this.codec = 'V_VP9';
    this.encoder = new VideoEncoder({
      output: (chunk) => this.#keep(chunk),
      error: (fault) => {
        this.fault = fault;
      },
    });
  }

  /**
   * @param {Researcher.EpisodeRecord} record
   * @param {string} who
   */
  static async open(record, who) {
    const board = document.createElement('canvas');
    const recorder = new VideoRecorder(record, who, board, await rendererOf(board, record, who, VIDEO_SIZE));
    await recorder.#configure();
    return recorder;
  }

  async #configure() {
    const size = { width: this.canvas.width, height: this.canvas.height, bitrate: BITS_PER_SECOND };
    for (const [codec, name] of CODECS) {
      if (!(await VideoEncoder.isConfigSupported({ ...size, codec })).supported) continue;
      this.codec = name;
      this.encoder.configure({ ...size, codec });
      return;
    }
    throw new Error('this browser encodes neither VP9 nor VP8');
  }

  /** @param {EncodedVideoChunk} chunk */
  #keep(chunk) {
    const data = new Uint8Array(chunk.byteLength);
    chunk.copyTo(data);
    this.frames.push({ data, ms: Math.round(chunk.timestamp / 1000), key: chunk.type === 'key' });
  }

  /**
   * Add one timestep, as it was on the participant's screen.
   * @param {number} t
   */
  async add(t) {
    const { rows, game } = this.gameRecord;
    const { state } = rows[t];
    const isFirst = this.state === null;
    const before = this.state ?? boardState(game, state, this.nowMs);
    this.state = apply(before, frameOf(rows[t]), this.nowMs);
    if (!isFirst) this.renderer.applyEvents(this.state, this.nowMs);
    for (let frame = 0; frame < FRAMES_PER_TICK; frame += 1) {
      this.renderer.draw(this.state, this.nowMs, false);
      this.#compose(t, state.score);
      await this.#encode(game.tick_ms / FRAMES_PER_TICK);
      this.nowMs += game.tick_ms / FRAMES_PER_TICK;
    }
  }

  /**
   * Put the board and a caption below it on the canvas.
   * @param {number} t
   * @param {number} score
   */
  #compose(t, score) {
    const { context, canvas, board } = this;
    const words = `${this.who} · ${this.gameRecord.game.title} · t ${t} · score ${score}`;
    context.fillStyle = '#fff';
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.drawImage(board, 0, 0);
    context.fillStyle = '#22303c';
    context.font = '600 18px system-ui, sans-serif';
    context.textBaseline = 'middle';
    context.fillText(words, 12, board.height + CAPTION / 2, canvas.width - 24);
  }

  /** @param {number} lengthMs */
  async #encode(lengthMs) {
    const times = { timestamp: Math.round(1000 * this.nowMs), duration: Math.round(1000 * lengthMs) };
    const frame = new VideoFrame(this.canvas, times);
    this.encoder.encode(frame, { keyFrame: this.count % KEY_FRAME_EVERY === 0 });
    frame.close();
    this.count += 1;
    while (this.encoder.encodeQueueSize > MAX_QUEUED && !this.fault) {
      await new Promise((resolve) => {
        setTimeout(resolve, 5);
      });
    }
    if (this.fault) throw this.fault;
  }

  async finish() {
    await this.encoder.flush();
    this.encoder.close();
    const { width, height } = this.canvas;
    return webm({ codec: this.codec, width, height, ms: this.nowMs }, this.frames);
  }
}

/**
 * @param {Blob} blob
 * @param {string} name
 */
function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
