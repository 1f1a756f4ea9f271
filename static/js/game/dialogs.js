// Puts the message that choose-dialog.js chose on the page: start, countdown, pause, banner, end, other tab. Text and buttons only.

const PARTS = { start: 'start', count: 'count', pause: 'pause', banner: 'banner', over: 'over', closed: 'closed' };

export class Overlay {
  /** `page`: the game's element; `text`: catalogue; `does`: {ready(), takeOver(), reload()}. */
  constructor(page, text, does) {
    Object.assign(this, { page, text, shown: '' });
    this.find = (selector) => page.querySelector(selector);
    this.find('#start-button').addEventListener('click', does.ready);
    this.find('#pause-button').addEventListener('click', does.ready);
    this.find('#closed-button').addEventListener('click', does.reload);
    document.querySelector('#other-here').addEventListener('click', does.takeOver);
    document.querySelector('#other-stay').addEventListener('click', () => this.#stay());
  }

  /** Shows `view`. Returns true if another message than before is shown now. */
  show(view, state) {
    const same = `${view.name}:${view.reason}`;
    const changed = same !== this.shown;
    if (changed) this.#swap(view, state);
    this.shown = same;
    this.#seconds(view);
    return changed;
  }

  #swap(view, state) {
    for (const [name, id] of Object.entries(PARTS)) this.find(`#${id}`).hidden = view.name !== name;
    this.find('#veil').hidden = !['start', 'count', 'pause', 'over', 'closed'].includes(view.name);
    this.find('.stage').classList.toggle('dim', view.name === 'banner' || view.name === 'closed');
    this.page.hidden = view.name === 'other';
    document.querySelector('#other').hidden = view.name !== 'other';
    const fill = { count: () => this.#count(view), start: () => this.#start(view, state), pause: () => this.#pause(view), banner: () => this.#banner(view), over: () => this.#over(state), closed: () => this.find('#closed-button').focus({ preventScroll: true }) };
    fill[view.name]?.();
    if (view.name === 'other') document.querySelector('#other-here').focus();
  }

  #start(view, { game }) {
    const kind = view.reason === 'episode' && game.partner === 'human' ? 'together' : view.reason;
    const values = { number: game.number, episodes: game.episodes, title: game.title, seconds: Math.round(game.horizon * game.tick_ms / 1000) };
    this.find('#start-title').textContent = this.text(`start.${kind}.title`, values);
    this.find('#start-text').textContent = this.text(`start.${kind}.text`, values);
    this.find('#start-button').textContent = this.text(`start.${kind}.button`, values);
    this.find('#start-button').focus({ preventScroll: true });
    track(this.find('#track'), game);
  }

  #pause(view) {
    this.find('#pause-title').textContent = this.text(`pause.${view.reason}.title`);
    this.find('#pause-text').textContent = this.text(`pause.${view.reason}.text`);
    const button = this.find('#pause-button');
    button.hidden = !view.action;
    if (view.action) button.textContent = this.text(`pause.${view.reason}.button`);
    if (view.action) button.focus({ preventScroll: true });
  }

  #banner(view) {
    this.find('#banner-title').textContent = this.text(`banner.${view.reason}.title`);
    this.find('#banner-text').textContent = this.text(`banner.${view.reason}.text`);
  }

  #over({ ended, game }) {
    const tutorial = game?.kind === 'tutorial';
    const kind = tutorial ? (ended.passed ? 'passed' : 'again') : ended.passed ? 'episode' : game?.partner === 'human' ? 'parted' : 'stopped';
    this.find('#over-title').textContent = this.text(`over.${kind}.title`);
    this.find('#over-text').textContent = this.text(kind === 'episode' && ended.soups > 0 ? 'over.episode.served' : `over.${kind}.text`);
    this.find('#over-score').textContent = ended.score;
    this.find('#over-soups').textContent = ended.soups;
    const link = this.find('#over-next');
    const next = new URL(ended.next, location.href);
    link.href = next.origin === location.origin ? next.pathname + next.search : '/';
    link.textContent = this.text(`over.${kind}.button`);
    // A hand that still plays must not press the button unseen.
    link.classList.add('wait');
    setTimeout(() => { link.classList.remove('wait'); link.focus({ preventScroll: true }); }, 700);
  }

  #count({ reason }) {
    this.find('#count-title').textContent = this.text(`count.${reason}.title`);
    this.find('#count-text').textContent = this.text(`count.${reason}.text`);
  }

  #seconds(view) {
    if (view.name === 'count') {
      [...this.find('#count-numbers').children].forEach((dot) => {
        const number = Number(dot.textContent);
        dot.classList.toggle('now', number === view.seconds);
        dot.classList.toggle('past', number > view.seconds);
      });
    }
    const place = { start: '#start-left', pause: '#pause-left', banner: '#banner-left' }[view.name];
    if (!place) return;
    const words = view.seconds === null ? '' : this.text('seconds_left', { seconds: view.seconds });
    const element = this.find(place);
    if (element.textContent !== words) element.textContent = words;
  }

  #stay() {
    const note = document.querySelector('#other-note');
    note.textContent = note.dataset.stayed;
    window.close(); // works only for tabs that a script opened; the note remains for all others
  }
}

/** The row of rounds: done, now, to come. */
function track(list, { kind, number, episodes }) {
  list.hidden = kind !== 'episode' || episodes < 2;
  list.replaceChildren(...Array.from({ length: Math.min(episodes, 20) }, (_, index) => {
    const item = document.createElement('li');
    item.textContent = index + 1;
    item.className = index + 1 < number ? 'done' : index + 1 === number ? 'now' : '';
    if (index + 1 === number) item.setAttribute('aria-current', 'step');
    return item;
  }));
}
