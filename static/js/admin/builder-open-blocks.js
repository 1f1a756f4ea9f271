// Which blocks of the study builder's form are open.

import { keyOf } from './builder-fields.js';

/** @typedef {import('./builder-session.js').Operation} Operation */

/**
 * Keep open what is open when the items of a list get other places.
 * @param {Set<string>} opened the keys of blocks and sections that are open
 * @param {Operation} operation
 * @returns {Set<string> | null} what is open after it; null: no item gets another place
 */
export function openAfter(opened, operation) {
  const isRemoved = operation.do === 'remove';
  if (operation.do !== 'move' && !isRemoved) return null;
  const list = isRemoved ? operation.path.slice(0, -1) : operation.path;
  const from = isRemoved ? Number(operation.path.at(-1)) : operation.index;
  const to = isRemoved ? Infinity : operation.to;
  if (Number.isNaN(from)) return null;
  const after = [...opened].flatMap((key) => {
    const path = key.startsWith('[') ? JSON.parse(key) : [];
    const at = path[list.length];
    if (typeof at !== 'number' || keyOf(path.slice(0, list.length)) !== keyOf(list)) return [key];
    if (at === from && isRemoved) return [];
    const place = at === from ? to : at > from && at <= to ? at - 1 : at < from && at >= to ? at + 1 : at;
    return [keyOf([...list, place, ...path.slice(list.length + 1)])];
  });
  return new Set(after);
}

/**
 * Open every block around a field, and give it the focus, which scrolls to it.
 * @param {HTMLElement} field
 */
export function focusInside(field) {
  for (let up = field.closest('details'); up; up = up.parentElement?.closest('details') ?? null) up.open = true;
  field.focus();
}
