// Addresses of our pages: below the path of the public address, if it has one.

export const root = document.documentElement.dataset.root ?? '';
export const SPRITES = `${root}/static/sprites/`;
