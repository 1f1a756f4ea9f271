// A message of the researcher: outside the board and its dialog, for as long as it takes to read, and told to screen
// readers.

import { find } from '../browser/dom.js';

const MIN_MS = 10_000;
const LETTER_MS = 90; // a slow reader of an alphabet
const CHARACTER_MS = 350; // and of Chinese, Japanese or Korean
const AGAIN_MS = 3000;
const MARGIN = 8;
const MIN_ROOM = 36; // pixels: a line of words and the button

/**
 * Return how long a text stays on screen.
 * @param {string} words
 */
export function readingMs(words) {
  const wide = words.match(/[\u3040-\u30ff\u3400-\u9fff\uac00-\ud7af\uf900-\ufaff]/g)?.length ?? 0;
  return Math.max(MIN_MS, 5000 + wide * CHARACTER_MS + (words.length - wide) * LETTER_MS);
}

export class ResearcherNotice {
  /**
   * @param {HTMLElement} box
   * @param {HTMLElement} stage
   * @param {() => void} closed by the participant
   * @param {(words: string) => void} say
   */
  constructor(box, stage, closed, say) {
    this.box = box;
    this.stage = stage;
    this.say = say;
    this.words = find('p', HTMLElement, box);
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
    find('button', HTMLElement, box).addEventListener('click', () => {
      this.#hide();
      closed();
    });
    addEventListener('resize', () => this.#place());
    const game = stage.closest('.game');
    if (game) new MutationObserver(() => this.#place()).observe(game, { attributeFilter: ['data-view'] });
  }

  /** @param {string} words */
  show(words) {
    this.words.textContent = words;
    this.box.hidden = false;
    this.#place();
    this.say(words);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#leave(), readingMs(words));
  }

  /** Keep it while it is pointed at or has the focus, and while the page is hidden. */
  #leave() {
    if (document.hidden || this.box.matches(':hover, :focus-within')) {
      this.timer = setTimeout(() => this.#leave(), AGAIN_MS);
    } else this.#hide();
  }

  #hide() {
    clearTimeout(this.timer);
    this.box.hidden = true;
  }

  /** Return where the dialog of a pause or of the countdown ends, which has the space above the board; null: none. */
  #dialogBottom() {
    const shown = this.stage.querySelector('#pause:not([hidden]), #count:not([hidden])')?.getBoundingClientRect();
    return shown?.height ? shown.bottom : null;
  }

  /**
   * Use the space above the board, below it if a dialog is above, or next to the board if there is none. A long text
   * scrolls there.
   */
  #place() {
    const board = this.stage.querySelector('canvas.board')?.getBoundingClientRect();
    if (this.box.hidden || !board) return;
    const dialog = this.#dialogBottom();
    const top = dialog === null ? MARGIN : board.bottom + MARGIN;
    const height = dialog === null ? board.top - 2 * MARGIN : innerHeight - top - MARGIN;
    if (height < MIN_ROOM) this.#placeAtSide(board, dialog ?? 0);
    else this.#fill({ top, height });
  }

  /**
   * @param {DOMRect} board
   * @param {number} above what ends here is not covered
   */
  #placeAtSide(board, above) {
    const onLeft = board.left > innerWidth - board.right;
    const width = (onLeft ? board.left : innerWidth - board.right) - 2 * MARGIN;
    const top = above + MARGIN;
    this.#fill({ top, height: innerHeight - top - MARGIN, left: onLeft ? MARGIN : board.right + MARGIN, width });
  }

  /** @param {{ top: number, height: number, left?: number, width?: number }} space with `left`: next to the board */
  #fill({ top, height, left, width }) {
    const { classList, style } = this.box;
    const isAtSide = left !== undefined;
    classList.toggle('at-side', isAtSide);
    classList.remove('tight');
    style.top = `${top}px`;
    style.maxHeight = `${height}px`;
    style.width = isAtSide ? `${width}px` : '';
    style.left = isAtSide ? `${left}px` : '';
    classList.toggle('tight', !isAtSide && this.box.scrollHeight > this.box.clientHeight);
  }
}
