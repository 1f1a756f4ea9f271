// Keys of the replay, wherever on the page they are pressed.

/**
 * Listen to keys, except in controls that need them.
 * @param {Record<string, () => void>} actions by the key's name
 */
export function onKeys(actions) {
  document.addEventListener('keydown', (event) => {
    const inControl =
      event.target instanceof Element && event.target.closest('input:not(#scrub), textarea, select, dialog, button, a');
    if (inControl || event.ctrlKey || event.metaKey || event.altKey) return;
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}
