// Makes the picture and the video of a replay in this browser, faster than the game is played.

/** @import { Catalogue } from '../browser/texts.js' */
/** @import { State } from '../board/state.js' */

import { Renderer, pixelRatio } from '../board/renderer.js';
import { Sprites } from '../board/sprites.js';
import { apply } from '../board/state.js';
import { boardState } from '../board/still-board.js';
import { SPRITES } from '../browser/addresses.js';
import { context2d } from '../browser/dom.js';
import { frameOf } from './details.js';
import { VideoFile } from './video-file.js';

const FRAMES_PER_TICK = 5;
/** @typedef {[width: number, height: number]} Size at most, in pixels */
/** @type {Size} */
const VIDEO_SIZE = [960, 640];
/** @type {Size} large enough for print */
const PICTURE_SIZE = [1920, 1440];
const CAPTION = 40;

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
   * @param {HTMLElement} note says what was saved, or why nothing was
   * @param {Researcher.EpisodeRecord} record
   * @param {number} first timestep
   */
  async record(button, note, record, first) {
    if (this.running) {
      this.running.stopped = true;
      return;
    }
    const words = button.textContent;
    const running = { stopped: false };
    this.running = running;
    note.hidden = true;
    try {
      note.textContent = await this.#make(record, first, running, (percent) => {
        button.textContent = `${percent} %, stop`;
      });
    } catch (error) {
      const reason = error instanceof Error ? error.message : error;
      note.textContent = `The video was not saved: ${reason}. Try again, or use a newer browser.`;
    } finally {
      note.hidden = false;
      button.textContent = words;
      this.running = null;
    }
  }

  /**
   * Make a video, save it, and return what to say about it.
   * @param {Researcher.EpisodeRecord} record
   * @param {number} first timestep
   * @param {{ stopped: boolean }} running
   * @param {(percent: number) => void} tell
   */
  async #make(record, first, running, tell) {
    const recorder = await VideoRecorder.open(record, this.who);
    recorder.renderer.text = this.text;
    const last = record.rows.length - 1;
    const start = first < last ? first : 0;
    try {
      // One timestep at least: a file without frames cannot be played.
      for (let t = start; t <= last && (t === start || !running.stopped); t += 1) {
        await recorder.add(t);
        tell(Math.round((100 * t) / last));
      }
      const { ending, words } = recorder.file.kind;
      save(await recorder.file.finish(), `${this.name}.${ending}`);
      return words;
    } catch (error) {
      await recorder.file.discard().catch(() => {}); // the first error is the cause
      throw error;
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

/** Draws one timestep after another on a canvas of its own and adds what is on it to a file. */
class VideoRecorder {
  /**
   * @param {Researcher.EpisodeRecord} record
   * @param {string} who
   * @param {HTMLCanvasElement} board
   * @param {Renderer} renderer draws on the board
   * @param {HTMLCanvasElement} canvas board and caption
   * @param {VideoFile} file of this canvas
   */
  constructor(record, who, board, renderer, canvas, file) {
    this.gameRecord = record;
    this.who = who;
    this.board = board;
    this.renderer = renderer;
    this.canvas = canvas;
    this.context = context2d(canvas);
    this.file = file;
    /** @type {State | null} */
    this.state = null;
    this.nowMs = 0;
  }

  /**
   * @param {Researcher.EpisodeRecord} record
   * @param {string} who
   */
  static async open(record, who) {
    const board = document.createElement('canvas');
    const renderer = await rendererOf(board, record, who, VIDEO_SIZE);
    const canvas = document.createElement('canvas');
    canvas.width = board.width + (board.width % 2); // H.264 needs even sides
    canvas.height = board.height + CAPTION + (board.height % 2);
    context2d(canvas); // the encoder's trial needs a picture
    const file = await VideoFile.open(canvas, FRAMES_PER_TICK * record.rows.length);
    return new VideoRecorder(record, who, board, renderer, canvas, file);
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
      await this.file.add(this.nowMs, game.tick_ms / FRAMES_PER_TICK);
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
