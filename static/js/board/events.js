// What happened between two kitchens, for effects, sounds and announcements. Looks at what is seen, knows no rules.

import { COOK_TIME, SOUP, STEP } from './kitchen.js';

/** [{kind: 'delivery' | 'ready' | 'potted' | 'started' | 'taken' | 'put' | 'bump', x, y, seat}]; (x, y) the cell where it shows. */
export function events(before, after, actions, grid) {
  if (!before || after.t <= before.t) return [];
  return [...hands(before, after, grid), ...pots(before, after), ...bumps(before, after, actions)];
}

function hands(before, after, grid) {
  const list = [];
  after.players.forEach(([x, y, facing, held], seat) => {
    const had = before.players[seat][3];
    if (had === held) return;
    const cell = { x: x + STEP[facing][0], y: y + STEP[facing][1], seat, item: held || had };
    const tile = grid[cell.y]?.[cell.x];
    if (had === SOUP && held === 0 && tile === 'S') list.push({ kind: 'delivery', ...cell });
    else if (held === 0) list.push({ kind: tile === 'P' ? 'potted' : 'put', ...cell });
    else list.push({ kind: 'taken', ...cell });
  });
  return list;
}

function pots(before, after) {
  const old = new Map(before.pots.map(([x, y, , tick]) => [`${x},${y}`, tick]));
  const list = [];
  for (const [x, y, , tick] of after.pots) {
    const was = old.get(`${x},${y}`) ?? -1;
    if (tick >= COOK_TIME && was < COOK_TIME) list.push({ kind: 'ready', x, y });
    else if (tick >= 0 && was < 0) list.push({ kind: 'started', x, y });
  }
  return list;
}

function bumps(before, after, actions) {
  return after.players.flatMap(([x, y], seat) => {
    const [oldX, oldY] = before.players[seat];
    return actions[seat] < 4 && x === oldX && y === oldY ? [{ kind: 'bump', x, y, seat }] : [];
  });
}
