// Where our pages lie: behind the path of the public address, if it has one.

export const root = document.documentElement.dataset.root ?? '';
export const SPRITES = `${root}/static/sprites/`;
