/** Sound beside a clip: in step with its time, silent if browsers or visitors mute it, with captions. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, frames, nextEvent, showLoaded, until } from './support/harness.js';
import { sendTouch } from './support/screen.js';
import { tone } from './support/tone.js';

const CLIP = '/net/clip/ball.gsv';
/** On a machine that has nothing else to do. */
const LIMIT_MS = 2_000;
/** After its start sound comes into step without a jump that could be heard. */
const SETTLED_MS = 2_500;

const CAPTIONS = `WEBVTT

00:00.000 --> 00:00.500
A ball

00:00.500 --> 00:01.200
<b>changes</b> its color
`;

async function showWithSound(isMuted = true): Promise<[GaussianSplatElement, HTMLAudioElement]> {
  const element = await showLoaded({ src: CLIP });
  const audio = Object.assign(document.createElement('audio'), { src: tone(1.2), slot: 'sound', muted: isMuted });
  const track = Object.assign(document.createElement('track'), { kind: 'captions', srclang: 'en', default: true });
  track.src = URL.createObjectURL(new Blob([CAPTIONS], { type: 'text/vtt' }));
  audio.append(track);
  element.append(audio);
  // Browsers allow sound once a person has touched the page.
  await sendTouch('touchStart', [{ x: 400, y: 400 }]);
  await sendTouch('touchEnd', []);
  await until(
    () => element.muted !== undefined && audio.readyState >= 2,
    'the code for sound, and the sound',
    LIMIT_MS,
  );
  return [element, audio];
}

/** Lets an element play by a separate clock that starts 80 ms late and runs 0.2 % too fast: on a machine without a sound card, which draws on its CPU, real sound stutters. */
function steady(audio: HTMLAudioElement): void {
  let [at, since, rate, isPaused] = [0, 0, 1, true];
  const now = (): number => (isPaused ? at : at + Math.max(0, (1.002 * rate * (performance.now() - since)) / 1000));
  const set = (change: () => void): void => {
    at = now();
    since = Math.max(since, performance.now());
    change();
  };
  Object.defineProperties(audio, {
    currentTime: { get: now, set: (seconds: number) => set(() => (at = seconds)) },
    playbackRate: { get: () => rate, set: (value: number) => set(() => (rate = value)) },
    paused: { get: () => isPaused },
    pause: { value: () => set(() => (isPaused = true)) },
    play: {
      value: () => {
        if (isPaused) since = performance.now() + 80;
        isPaused = false;
        return Promise.resolve();
      },
    },
  });
}

describe('sound', () => {
  it('runs with the clip, within 40 ms, at its speed, and stands with it', async () => {
    const [element, audio] = await showWithSound();
    assertEqual(element.muted, true, 'muted');
    steady(audio);
    element.playbackRate = 0.25;
    const off: number[] = [];
    const ended = nextEvent(element, 'ended');
    let [before, begun] = [NaN, 0];
    // The visible splats belong to the time of their frame: the clock has reached it once all callbacks of the frame
    // have run.
    const look = (frameTime: number): void => {
      if (element.ended) return;
      requestAnimationFrame(look);
      setTimeout(() => {
        const { currentTime } = element;
        const isNew = currentTime !== before && !audio.paused && !audio.seeking && !element.paused;
        before = currentTime;
        if (!isNew || performance.now() - (begun ||= performance.now()) < SETTLED_MS) return;
        off.push(Math.abs((audio.currentTime - currentTime) / 0.25 - (performance.now() - frameTime) / 1000));
      });
    };
    requestAnimationFrame(look);
    await element.play();
    await until(() => !audio.paused, 'sound', LIMIT_MS);
    await ended;
    await until(() => audio.paused, 'silence', LIMIT_MS);
    off.sort((a, b) => a - b);
    console.log(`sound is off by ${off.map((value) => (1000 * value).toFixed(0)).join(', ')} ms`);
    assert(off.length > 2 && off[Math.floor(0.8 * off.length)] <= 0.04, `off by ${off.join(', ')} s`);
  });

  it('follows seeks and pauses, loops, and says when it is muted', async () => {
    const [element, audio] = await showWithSound();
    const seeked = nextEvent(element, 'seeked');
    element.currentTime = 0.75;
    await seeked;
    await until(() => Math.abs(audio.currentTime - 0.75) < 0.02, 'the sound of that time', LIMIT_MS);
    assertEqual(audio.paused, true, 'paused');
    const changed = nextEvent(element, 'volumechange', LIMIT_MS);
    element.muted = false;
    await changed;
    assertEqual([audio.muted, element.muted], [false, false], 'muted');
    element.muted = true;
    element.volume = 0.25;
    assertEqual(audio.volume, 0.25, 'volume');
    element.loop = true;
    let [last, rounds] = [0, 0];
    element.addEventListener('timeupdate', () => {
      if (element.currentTime < last) rounds++;
      last = element.currentTime;
    });
    await element.play();
    await until(() => rounds >= 2 && !audio.paused, 'two rounds', 4 * LIMIT_MS);
    element.style.marginTop = '5000px';
    await until(() => audio.paused, 'silence out of view', 2 * LIMIT_MS);
    assertEqual(element.paused, false, 'the scene is not paused');
    element.style.marginTop = '';
    await until(() => !audio.paused, 'sound again', LIMIT_MS);
    element.pause();
    await until(() => audio.paused, 'silence', LIMIT_MS);
    audio.remove();
    await frames(2);
    assertEqual(element.muted, true, 'without sound');
  });

  it('shows the captions of its time', async () => {
    const [element, audio] = await showWithSound();
    const box = (): string => element.shadowRoot!.querySelector('[part=captions]')?.textContent ?? '';
    element.currentTime = 0.2;
    await until(() => box() === 'A ball', 'the first line', LIMIT_MS);
    element.currentTime = 0.8;
    await until(() => box() === 'changes its color', 'the second line', LIMIT_MS);
    audio.textTracks[0].mode = 'disabled';
    await until(() => box() === '', 'no line', LIMIT_MS);
  });
});
