// How a number that somebody wrote is read. The same rule as `read_number` in server/study/numbers.py; a test compares them.

const SPACE = '[ \\t\\n\\r\\u00a0\\u2000-\\u200a\\u202f\\u3000]';
const EDGES = new RegExp(`^${SPACE}+|${SPACE}+$`, 'g');
const WIDE = /[\uff0b-\uff0e\uff10-\uff19]/g; // + , - . and digits as East Asian keyboards write them
const LONGEST = 32;
const AMBIGUOUS = /^[+-]?[1-9]\d{0,2}[.,]\d{3}$/;
const PLAIN = /^[+-]?(\d+[.,]?\d*|[.,]\d+)$/;
const GROUPED = new RegExp(`^[+-]?\\d+((${SPACE}|[.,'’_])\\d+)+$`);

/** {value} of a written number, or {reason: 'ambiguous_number' | 'grouped_number' | 'missing_number'}. */
export function readNumber(text) {
  const plain = text.replace(EDGES, '').replace(WIDE, (wide) => String.fromCharCode(wide.charCodeAt(0) - 0xfee0)).replace(/\u2212/g, '-');
  if (plain.length > LONGEST) return { reason: 'missing_number' };
  if (AMBIGUOUS.test(plain)) return { reason: 'ambiguous_number' };
  if (PLAIN.test(plain)) return { value: Number(plain.replace(',', '.')) };
  return { reason: GROUPED.test(plain) ? 'grouped_number' : 'missing_number' };
}
