// Encodes what is on a canvas to a video file: MP4 (H.264) where the browser can, otherwise WebM.

const BITS_PER_SECOND = 1_000_000;
const KEY_FRAME_EVERY = 50;

/** @typedef {typeof import('../../vendor/mediabunny/mediabunny.min.mjs')} Library */
/** @typedef {{ codec: 'avc' | 'vp9' | 'vp8', ending: 'mp4' | 'webm', words: string }} VideoKind */

const WEBM_WORDS =
  'Saved as WebM, because this browser cannot encode H.264 for MP4. PowerPoint and Keynote do not play WebM; ' +
  'Chrome and Edge on Windows or macOS save MP4.';
/** @type {VideoKind[]} the first that the browser encodes is used */
const KINDS = [
  { codec: 'avc', ending: 'mp4', words: 'Saved as MP4 (H.264), which PowerPoint, Keynote and browsers play.' },
  { codec: 'vp9', ending: 'webm', words: WEBM_WORDS },
  { codec: 'vp8', ending: 'webm', words: WEBM_WORDS },
];

export class VideoFile {
  /**
   * @param {Library} library
   * @param {HTMLCanvasElement} canvas with even sides, as H.264 needs
   * @param {VideoKind} kind
   * @param {number} maxFrames
   */
  constructor(library, canvas, kind, maxFrames) {
    this.kind = kind;
    this.maxFrames = maxFrames;
    this.count = 0;
    this.target = new library.BufferTarget();
    // The index of an MP4 comes first, so that a page can play it while it loads; its space is reserved, because the
    // default keeps all frames in memory a second time.
    const format =
      kind.ending === 'mp4' ? new library.Mp4OutputFormat({ fastStart: 'reserve' }) : new library.WebMOutputFormat();
    this.output = new library.Output({ format, target: this.target });
    const quality = new library.Quality({ bitrate: BITS_PER_SECOND });
    this.source = new library.CanvasSource(canvas, { codec: kind.codec, quality });
  }

  /**
   * Open a file of the first kind that this browser encodes.
   * @param {HTMLCanvasElement} canvas
   * @param {number} maxFrames
   */
  static async open(canvas, maxFrames) {
    // 690 kB: loaded only when a video is made.
    const library = await import('../../vendor/mediabunny/mediabunny.min.mjs');
    for (const kind of KINDS) {
      if (!(await encodes(library, canvas, kind))) continue;
      const file = new VideoFile(library, canvas, kind, maxFrames);
      await file.start();
      return file;
    }
    throw new Error('this browser encodes neither H.264 nor VP9 nor VP8');
  }

  async start() {
    this.output.addVideoTrack(this.source, { maximumPacketCount: this.maxFrames });
    await this.output.start();
  }

  /**
   * Add what is on the canvas now. Wait if the encoder has much to do.
   * @param {number} atMs
   * @param {number} lengthMs
   */
  async add(atMs, lengthMs) {
    const keyFrame = this.count % KEY_FRAME_EVERY === 0;
    this.count += 1;
    await this.source.add(atMs / 1000, lengthMs / 1000, { keyFrame });
  }

  /** @returns {Promise<Blob>} */
  async finish() {
    await this.output.finalize();
    return new Blob([this.target.buffer ?? new ArrayBuffer(0)], { type: `video/${this.kind.ending}` });
  }

  /** Free the encoder after a fault. */
  async discard() {
    await this.output.cancel();
  }
}

/**
 * Return whether the browser encodes the canvas. Try one frame: some browsers name codecs that then fail.
 * @param {Library} library
 * @param {HTMLCanvasElement} canvas
 * @param {VideoKind} kind
 */
async function encodes(library, canvas, kind) {
  const quality = new library.Quality({ bitrate: BITS_PER_SECOND });
  const { width, height } = canvas;
  if (!(await library.canEncodeVideo(kind.codec, { width, height, quality }))) return false;
  const trial = new VideoFile(library, canvas, kind, 1);
  try {
    await trial.start();
    await trial.add(0, 1000);
    return (await trial.finish()).size > 0;
  } catch {
    await trial.discard().catch(() => {});
    return false;
  }
}
