// The clock of the animation: how many expansions are shown, for all panels the same number.

const SECONDS = 3.5;
const $ = (id) => document.getElementById(id);

export class Player {
  /** `onStep` is called whenever another number of expansions is to be shown. */
  constructor(onStep) {
    this.onStep = onStep;
    this.total = 0;
    this.step = 0;
    this.frame = null;
    $('play').addEventListener('click', () => (this.isPlaying ? this.pause() : this.play()));
    $('scrub').addEventListener('input', () => {
      this.pause();
      this.show(Number($('scrub').value));
    });
  }

  get isPlaying() {
    return this.frame !== null;
  }

  /** Take the number of expansions of the longest search, and show its end. */
  setTotal(total) {
    this.pause();
    this.total = total;
    $('scrub').max = String(total);
    $('play').disabled = total === 0;
    this.show(total);
  }

  play() {
    if (this.step >= this.total) this.show(0);
    let last = null;
    const tick = (now) => {
      const seconds = last === null ? 0 : Math.min(0.1, (now - last) / 1000);
      last = now;
      this.frame = requestAnimationFrame(tick);
      this.show(this.step + (seconds * Number($('speed').value) * this.total) / SECONDS);
      if (this.step >= this.total) this.pause();
    };
    this.frame = requestAnimationFrame(tick);
    this.showLabel();
  }

  pause() {
    if (this.frame !== null) cancelAnimationFrame(this.frame);
    this.frame = null;
    this.showLabel();
  }

  show(step) {
    this.step = Math.min(this.total, Math.max(0, step));
    const whole = Math.round(this.step);
    $('scrub').value = String(whole);
    $('step-count').textContent =
      `${whole.toLocaleString('en')} of ${this.total.toLocaleString('en')}`;
    this.showLabel();
    this.onStep();
  }

  showLabel() {
    $('play').textContent = this.isPlaying ? 'Pause' : this.step >= this.total ? 'Replay' : 'Play';
  }

  /** Return the part (0 to 1) of a search of so many expansions that is shown. */
  partOf(expansions) {
    return expansions ? Math.min(1, this.step / expansions) : 1;
  }
}
