// Writes a WebM file around encoded frames (Matroska: elements of id, length and content).

/** @typedef {Uint8Array<ArrayBuffer>} Bytes */
/** @typedef {{ data: Bytes, ms: number, key: boolean }} EncodedFrame */
/** @typedef {{ codec: 'V_VP8' | 'V_VP9', width: number, height: number, ms: number }} Film ms: its length */

const CLUSTER_MS = 10_000; // a frame's time counts from its cluster's, in 16 bits

/** @type {(words: string) => Bytes} */
const text = (words) => new TextEncoder().encode(words);

/**
 * Return a whole number, most significant byte first, in as few bytes as it needs.
 * @param {number} number
 * @returns {Bytes}
 */
function whole(number) {
  const bytes = [];
  for (let rest = number; rest > 0 || !bytes.length; rest = Math.floor(rest / 256)) bytes.unshift(rest % 256);
  return Uint8Array.from(bytes);
}

/**
 * @param {number} number
 * @returns {Bytes}
 */
function float(number) {
  const view = new DataView(new ArrayBuffer(8));
  view.setFloat64(0, number);
  return new Uint8Array(view.buffer);
}

/**
 * Return the parts of an element; its length always takes eight bytes.
 * @param {number} id
 * @param {(Bytes | Bytes[])[]} content
 * @returns {Bytes[]}
 */
function element(id, ...content) {
  const parts = content.flat();
  const length = parts.reduce((sum, part) => sum + part.byteLength, 0);
  const size = new DataView(new ArrayBuffer(8));
  size.setBigUint64(0, BigInt(length));
  size.setUint8(0, 1);
  return [whole(id), new Uint8Array(size.buffer), ...parts];
}

/**
 * @param {EncodedFrame} frame
 * @param {number} startMs
 */
function block({ data, ms, key }, startMs) {
  const head = new DataView(new ArrayBuffer(4));
  head.setUint8(0, 0x81); // track 1
  head.setInt16(1, ms - startMs);
  head.setUint8(3, key ? 0x80 : 0);
  return element(0xa3, new Uint8Array(head.buffer), data);
}

/**
 * Divide frames into clusters; each begins with a key frame.
 * @param {EncodedFrame[]} frames
 */
function clustersOf(frames) {
  /** @type {EncodedFrame[][]} */
  const clusters = [];
  for (const frame of frames) {
    const last = clusters[clusters.length - 1];
    const isNew = !last || (frame.key && frame.ms > last[0].ms) || frame.ms - last[0].ms >= CLUSTER_MS;
    if (isNew) clusters.push([frame]);
    else last.push(frame);
  }
  return clusters;
}

function header() {
  return element(
    0x1a45dfa3, // EBML
    element(0x4286, whole(1)), // EBMLVersion
    element(0x42f7, whole(1)), // EBMLReadVersion
    element(0x42f2, whole(4)), // EBMLMaxIDLength
    element(0x42f3, whole(8)), // EBMLMaxSizeLength
    element(0x4282, text('webm')), // DocType
    element(0x4287, whole(2)), // DocTypeVersion
    element(0x4285, whole(2)), // DocTypeReadVersion
  );
}

/** @param {Film} film */
function info(film) {
  return element(
    0x1549a966, // Info
    element(0x2ad7b1, whole(1_000_000)), // TimestampScale: ns in a ms
    element(0x4489, float(film.ms)), // Duration
    element(0x4d80, text('kitchenmind')), // MuxingApp
    element(0x5741, text('kitchenmind')), // WritingApp
  );
}

/** @param {Film} film */
function track(film) {
  return element(
    0xae, // TrackEntry
    element(0xd7, whole(1)), // TrackNumber
    element(0x73c5, whole(1)), // TrackUID
    element(0x83, whole(1)), // TrackType: video
    element(0x86, text(film.codec)), // CodecID
    element(0xe0, element(0xb0, whole(film.width)), element(0xba, whole(film.height))), // Video: width, height
  );
}

/**
 * Return the file.
 * @param {Film} film
 * @param {EncodedFrame[]} frames in order, with a key frame at least every 10 s
 */
export function webm(film, frames) {
  const clusters = clustersOf(frames).map((inside) => {
    const blocks = inside.map((frame) => block(frame, inside[0].ms));
    return element(0x1f43b675, element(0xe7, whole(inside[0].ms)), ...blocks);
  });
  const segment = element(0x18538067, info(film), element(0x1654ae6b, track(film)), ...clusters);
  return new Blob([...header(), ...segment], { type: 'video/webm' });
}
