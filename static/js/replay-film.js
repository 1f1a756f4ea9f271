// The picture and the video of a replay, made in this browser. Knows the canvas, not what is on it.

const TYPES = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm'];
const FRAMES_A_SECOND = 30;

export class Film {
  constructor(canvas, name) {
    Object.assign(this, { canvas, name, recorder: null });
  }

  picture(t) {
    this.canvas.toBlob((blob) => save(blob, `${this.name}-t${t}.png`), 'image/png');
  }

  /** Plays from the timestep shown (from the start, at the end) and saves what is seen; pressed again it stops there. */
  record(button, player, recordOf, begin) {
    if (this.recorder) { this.recorder.stop(); return; }
    begin();
    const words = button.textContent;
    const type = TYPES.find((each) => MediaRecorder.isTypeSupported(each));
    const parts = [];
    this.recorder = new MediaRecorder(this.canvas.captureStream(FRAMES_A_SECOND), { mimeType: type });
    this.recorder.addEventListener('dataavailable', ({ data }) => { if (data.size) parts.push(data); });
    this.recorder.addEventListener('stop', () => {
      this.recorder = null;
      player.stop();
      button.textContent = words;
      save(new Blob(parts, { type: 'video/webm' }), `${this.name}.webm`);
    });
    button.textContent = 'Stop and save';
    this.recorder.start(1000);
    const { rows, game } = recordOf();
    player.play(() => rows.length - 1, game.tick_ms, () => this.recorder?.stop());
  }
}

function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
