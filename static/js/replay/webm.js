// A WebM file around encoded pictures (Matroska: elements of id, length, content). Knows nothing of what is on them.

const CLUSTER_MS = 10_000; // a picture's time counts from its cluster's, in 16 bits
const text = (words) => new TextEncoder().encode(words);

/** A whole number, most significant byte first, in as few bytes as it needs. */
function whole(number) {
  const bytes = [];
  for (let rest = number; rest > 0 || !bytes.length; rest = Math.floor(rest / 256)) bytes.unshift(rest % 256);
  return Uint8Array.from(bytes);
}

function float(number) {
  const view = new DataView(new ArrayBuffer(8));
  view.setFloat64(0, number);
  return new Uint8Array(view.buffer);
}

/** The parts of an element; its length always takes eight bytes. */
function element(id, ...content) {
  const parts = content.flat();
  const length = parts.reduce((sum, part) => sum + part.byteLength, 0);
  const size = new DataView(new ArrayBuffer(8));
  size.setBigUint64(0, BigInt(length));
  size.setUint8(0, 1);
  return [whole(id), new Uint8Array(size.buffer), ...parts];
}

function block({ data, ms, key }, startMs) {
  const head = new DataView(new ArrayBuffer(4));
  head.setUint8(0, 0x81); // track 1
  head.setInt16(1, ms - startMs);
  head.setUint8(3, key ? 0x80 : 0);
  return element(0xa3, new Uint8Array(head.buffer), data);
}

/** The file. `film`: {codec: 'V_VP8' or 'V_VP9', width, height, ms: its length}; `pictures`: [{data, ms, key}] in order, keys at least every 10 s. */
export function webm(film, pictures) {
  const clusters = [];
  for (const picture of pictures) {
    const last = clusters.at(-1);
    if (!last || (picture.key && picture.ms > last[0].ms) || picture.ms - last[0].ms >= CLUSTER_MS) clusters.push([picture]);
    else last.push(picture);
  }
  const head = element(0x1a45dfa3, element(0x4286, whole(1)), element(0x42f7, whole(1)), element(0x42f2, whole(4)), element(0x42f3, whole(8)),
    element(0x4282, text('webm')), element(0x4287, whole(2)), element(0x4285, whole(2)));
  const info = element(0x1549a966, element(0x2ad7b1, whole(1_000_000)), element(0x4489, float(film.ms)), element(0x4d80, text('kitchenmind')), element(0x5741, text('kitchenmind')));
  const track = element(0xae, element(0xd7, whole(1)), element(0x73c5, whole(1)), element(0x83, whole(1)), element(0x86, text(film.codec)),
    element(0xe0, element(0xb0, whole(film.width)), element(0xba, whole(film.height))));
  const body = clusters.map((inside) => element(0x1f43b675, element(0xe7, whole(inside[0].ms)), ...inside.map((picture) => block(picture, inside[0].ms))));
  return new Blob([...head, ...element(0x18538067, info, element(0x1654ae6b, track), ...body)], { type: 'video/webm' });
}
