// The time of a player: its buttons and keys, and the loop that draws it.

let clock = 0, before = 0;

function goTo(frame) {
  state.frame = clamp(Math.round(frame), 0, frameCount - 1);
  clock = state.frame * frameTime;
  repaint();
}

function setPlaying(playing) {
  state.playing = playing && frameCount > 1;
  before = performance.now();
  $('play').setAttribute('aria-label', state.playing ? 'Stop' : 'Play');
  $('play').classList.toggle('playing', state.playing);
  repaint();
}

function tick(now) {
  waiting = false;
  if (state.playing) {
    clock = (clock + Math.max(0, now - before) / 1000 * state.speed) % (frameCount * frameTime);
    state.frame = Math.min(Math.floor(clock / frameTime + 1e-6), frameCount - 1);
    before = now;
  }
  painters.filter(painter => painter.visible).forEach(painter => painter.paint());
  state.draws += 1;
  if (state.playing) repaint();
}

const KEYS = {
  ' ': () => setPlaying(!state.playing),
  ArrowLeft: event => goTo(state.frame - (event.shiftKey ? 10 : 1)),
  ArrowRight: event => goTo(state.frame + (event.shiftKey ? 10 : 1)),
  Home: () => goTo(0),
  End: () => goTo(frameCount - 1),
  '+': () => zoomed(camera, 1.2),
  '-': () => zoomed(camera, 1 / 1.2),
};

function onKey(event) {
  const tag = event.target.tagName;
  const taken = tag === 'SELECT' || event.key === ' ' && ['BUTTON', 'SUMMARY'].includes(tag);
  if (!KEYS[event.key] || taken || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  KEYS[event.key](event);
  repaint();
}

/** Connects the slider, the buttons and the keys. */
function buildTransport() {
  $('slider').max = frameCount - 1;
  $('slider').disabled = $('play').disabled = frameCount < 2;
  $('slider').addEventListener('input', event => goTo(Number(event.target.value)));
  $('play').addEventListener('click', () => setPlaying(!state.playing));
  $('speed').addEventListener('change', event => { state.speed = Number(event.target.value); });
  addEventListener('keydown', onKey);
}

/** Shows the frame and its time beside the slider. */
function showFrame() {
  const seconds = (state.frame * frameTime).toFixed(2);
  $('slider').value = state.frame;
  $('slider').setAttribute('aria-valuetext', `frame ${state.frame} of ${frameCount - 1}, ${seconds} s`);
  $('now').textContent = `${state.frame} / ${frameCount - 1} · ${seconds} s`;
}
