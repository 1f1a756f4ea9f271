// The touch pad: buttons on the screen that act as keys. Several fingers at once; a finger may slide from one arrow to the next.
// That a finger is lifted may never be told (a button that was disabled meanwhile swallows it): other events show it too.

/** `buttons`: elements with data-action; `keys`: input.js Keys; `changed({held, tap})` is told every change. */
export function listenTouch(pad, keys, isPlaying, changed) {
  const fingers = new Map(); // pointer id -> button
  const kinds = new Map(); // pointer id -> touch, mouse or pen
  const tell = (change) => { if (change) changed(change); };
  const lift = (pointer) => {
    const button = fingers.get(pointer);
    if (!button) return;
    fingers.delete(pointer);
    button.classList.remove('down');
    tell(keys.release(`touch-${pointer}-${button.dataset.action}`));
  };
  const liftAll = (kind) => {
    for (const pointer of [...fingers.keys()]) if (kinds.get(pointer) === kind) lift(pointer);
  };
  const put = (pointer, button) => {
    fingers.set(pointer, button);
    button.classList.add('down');
    tell(keys.press(`touch-${pointer}-${button.dataset.action}`, Number(button.dataset.action)));
  };
  pad.addEventListener('pointerdown', (event) => {
    const button = event.target.closest('[data-action]');
    if (!button || !isPlaying()) return;
    event.preventDefault();
    if (event.isPrimary) liftAll(event.pointerType); // the first of its kind: the others are gone
    button.releasePointerCapture?.(event.pointerId);
    kinds.set(event.pointerId, event.pointerType);
    put(event.pointerId, button);
  });
  document.addEventListener('pointermove', (event) => {
    if (event.buttons === 0) lift(event.pointerId);
    const from = fingers.get(event.pointerId);
    if (!from || !from.closest('.pad')) return;
    const to = document.elementFromPoint(event.clientX, event.clientY)?.closest('.pad [data-action]');
    if (!to || to === from) return;
    lift(event.pointerId);
    put(event.pointerId, to);
  });
  for (const kind of ['pointerup', 'pointercancel']) window.addEventListener(kind, (event) => lift(event.pointerId), true);
  for (const kind of ['touchend', 'touchcancel']) {
    window.addEventListener(kind, (event) => { if (event.touches.length === 0) liftAll('touch'); }, { capture: true, passive: true });
  }
  // A button pressed without a pointer (screen reader, switch control) is a tap.
  pad.addEventListener('click', (event) => {
    const button = event.target.closest('[data-action]');
    if (!button || event.detail !== 0 || !isPlaying()) return;
    tell(keys.press('touch-click', Number(button.dataset.action)));
    tell(keys.release('touch-click'));
  });
}
