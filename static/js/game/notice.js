// A message of the researcher: outside the board, for as long as it takes to read, and told to screen readers.

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

  /** Use the space above the board, or next to it if there is none. A long text scrolls there. */
  #place() {
    const board = this.stage.querySelector('canvas.board')?.getBoundingClientRect();
    if (this.box.hidden || !board) return;
    const { style } = this.box;
    const isBeside = board.top - 2 * MARGIN < MIN_ROOM;
    const room = Math.max(board.left, innerWidth - board.right) - 2 * MARGIN;
    this.box.classList.toggle('at-side', isBeside);
    this.box.classList.remove('tight');
    style.maxHeight = `${isBeside ? innerHeight - 2 * MARGIN : board.top - 2 * MARGIN}px`;
    style.width = isBeside ? `${room}px` : '';
    style.left = isBeside ? `${board.left > innerWidth - board.right ? MARGIN : board.right + MARGIN}px` : '';
    this.box.classList.toggle('tight', !isBeside && this.box.scrollHeight > this.box.clientHeight);
  }
}
