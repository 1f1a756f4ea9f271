// Reads a number that a participant typed. The rule is that of server/study/read_number.py; a test compares them.

const SPACE = '[ \\t\\n\\r\\u00a0\\u2000-\\u200a\\u202f\\u3000]';
const EDGES = new RegExp(`^${SPACE}+|${SPACE}+$`, 'g');
const WIDE = /[\uff0b-\uff0e\uff10-\uff19]/g; // + , - . and digits as East Asian keyboards write them
const WIDE_OFFSET = 0xfee0;
const MAX_LENGTH = 32;
const AMBIGUOUS = /^[+-]?[1-9]\d{0,2}[.,]\d{3}$/;
const PLAIN = /^[+-]?(\d+[.,]?\d*|[.,]\d+)$/;
const GROUPED = new RegExp(`^[+-]?\\d+((${SPACE}|[.,'’_])\\d+)+$`);

/** @typedef {'ambiguous_number' | 'grouped_number' | 'missing_number'} NumberFault */

/**
 * Return the value of a written number, or the reason why it is not one.
 * @param {string} text
 * @returns {{ value: number, reason?: undefined } | { value?: undefined, reason: NumberFault }}
 */
export function readNumber(text) {
  const plain = text
    .replace(EDGES, '')
    .replace(WIDE, (wide) => String.fromCharCode(wide.charCodeAt(0) - WIDE_OFFSET))
    .replace(/\u2212/g, '-');
  if (plain.length > MAX_LENGTH) return { reason: 'missing_number' };
  if (AMBIGUOUS.test(plain)) return { reason: 'ambiguous_number' };
  if (PLAIN.test(plain)) return { value: Number(plain.replace(',', '.')) };
  return { reason: GROUPED.test(plain) ? 'grouped_number' : 'missing_number' };
}
