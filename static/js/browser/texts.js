// The words of the page: a catalogue that the server puts into it, filled in with numbers or with small elements (keys).

/** text(key, values) from a JSON block: `{name}` in the words is replaced. A missing key shows as itself. */
export function catalogue(words) {
  const text = (key, values = {}) => (words[key] ?? key).replace(/\{(\w+)\}/g, (whole, name) => String(values[name] ?? whole));
  /** The words as nodes; `values` may be strings or elements. */
  text.nodes = (key, values = {}) => (words[key] ?? key).split(/(\{\w+\})/).filter(Boolean).map((piece) => {
    const value = piece.startsWith('{') ? values[piece.slice(1, -1)] : piece;
    return value === undefined ? piece : value;
  });
  return text;
}

/** The JSON in `<script type="application/json" id=...>`. */
export function jsonBlock(id) {
  return JSON.parse(document.getElementById(id).textContent);
}
