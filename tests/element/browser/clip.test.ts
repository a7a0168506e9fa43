/** Clips: one file that is played by byte ranges, with the words of HTMLMediaElement. */
import '@gaussian-splat/element';
import { unzipSync } from 'fflate';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, atRest, COMPASS, nextEvent, show, showLoaded, until } from './support/harness.js';
import { isBlue, isGreen, isRed, screenOf, type Rgb } from './support/screen.js';

const CLIP = '/net/clip/ball.gsv';
/** Of the conformance corpus: an object of six splats that moves and turns. */
const MOVING = 'object/ObjectTrackComposed-UseChunkIndex-UseCrc';

async function shows(element: GaussianSplatElement, isColor: (colour: Rgb) => boolean): Promise<boolean> {
  return (await screenOf(element)).middleOf(isColor) !== null;
}

async function seek(element: GaussianSplatElement, seconds: number): Promise<void> {
  const seeked = nextEvent(element, 'seeked');
  element.currentTime = seconds;
  assert(element.seeking, 'seeking');
  await seeked;
}

async function showsAlone(element: GaussianSplatElement, frame: number): Promise<void> {
  const colours = [isRed, isGreen, isBlue];
  for (const [k, isColor] of colours.entries())
    assertEqual(await shows(element, isColor), k === frame % 3, `colour ${k} in frame ${frame}`);
}

const spansOf = ({ buffered }: GaussianSplatElement): number[][] =>
  Array.from({ length: buffered.length }, (_, k) => [buffered.start(k), buffered.end(k)]);

describe('a clip', () => {
  it('has a duration, and shows the frame of every time', async () => {
    const element = await showLoaded({ src: CLIP });
    assertEqual([element.duration, element.paused, element.currentTime], [1.2, true, 0], 'duration, paused, time');
    assertEqual(element.readyState, 4, 'readyState');
    await showsAlone(element, 0);
    for (const [seconds, frame] of [
      [0.15, 1],
      [0.35, 3],
      [0.55, 5],
      [1.15, 11],
      [0.05, 0],
    ] as const) {
      await seek(element, seconds);
      await showsAlone(element, frame);
    }
    await until(() => JSON.stringify(spansOf(element)) === '[[0,1.2]]', 'all of it is there');
  });

  it('begins at the time that is asked for', async () => {
    await showsAlone(await showLoaded({ src: CLIP, time: '0.85' }), 8);
  });

  it('plays to its end, and round and round with loop', async () => {
    const element = await showLoaded({ src: CLIP });
    const ended = nextEvent(element, 'ended');
    await element.play();
    await ended;
    assertEqual([element.paused, element.ended], [true, true], 'paused, ended');
    element.loop = true;
    let [last, rounds] = [0, 0];
    let waits = 0;
    element.addEventListener('waiting', () => waits++);
    await element.play();
    await until(() => {
      if (element.currentTime < last) rounds++;
      last = element.currentTime;
      return rounds >= 2;
    }, 'two rounds');
    element.pause();
    assertEqual(waits, 0, 'waits');
  });

  it('waits for what has not come, and goes on from there', async () => {
    const gate = `clip-${Math.round(performance.timeOrigin)}`;
    const element = await showLoaded({ src: `${CLIP}?gate=${gate}` });
    const said: string[] = [];
    for (const type of ['waiting', 'canplay', 'playing', 'ended'])
      element.addEventListener(type, () => said.push(`${type} ${element.currentTime.toFixed(1)}`));
    await element.play();
    await until(() => said.some((each) => each.startsWith('waiting')), 'it waits');
    const { currentTime } = element;
    assertEqual(element.readyState, 2, 'readyState');
    assert(currentTime > 0.39 && currentTime < 0.7, `it waits at ${currentTime} s, in the group that is missing`);
    await fetch(`/net/open/${gate}`);
    await until(() => said.some((each) => each.startsWith('ended')), 'it goes on to the end');
    const order = said.map((each) => each.split(' ')[0]);
    assertEqual(order.slice(0, 4), ['playing', 'waiting', 'canplay', 'playing'], 'events');
  });

  it('a seek into what is there takes the time of a frame, and no task of the page is long', async () => {
    const element = await showLoaded({ src: CLIP });
    await until(() => JSON.stringify(spansOf(element)) === '[[0,1.2]]', 'all of it is there');
    await seek(element, 0.55);
    const took: number[] = [];
    const tasks: number[] = [];
    const observer = new PerformanceObserver((list) =>
      tasks.push(...list.getEntries().map(({ duration }) => duration)),
    );
    observer.observe({ entryTypes: ['longtask'] });
    for (const seconds of [0.15, 0.95, 0.35, 1.15, 0.75, 0.05]) {
      const begin = performance.now();
      await seek(element, seconds);
      took.push(performance.now() - begin);
    }
    observer.disconnect();
    took.sort((a, b) => a - b);
    console.log(
      `warm seeks: ${took.map((ms) => ms.toFixed(0)).join(', ')} ms; long tasks: ${tasks.map((ms) => ms.toFixed(0)).join(', ')}`,
    );
    assert(took[took.length >> 1] < 600, `${took.join(', ')} ms`);
  });

  it('a seek into what has not come ends with the right frame', async () => {
    const element = await showLoaded({ src: `${CLIP}?slow=300` });
    await seek(element, 1.05);
    await showsAlone(element, 10);
  });

  it('a seek into what has not come takes half a second at 20 Mbit/s', async () => {
    // Groups of 300 kB, as those of 100,000 splats, and 30 ms until an answer begins.
    const element = await showLoaded({ src: `${CLIP}?mbps=20&slow=30&padded=300000&frames=120` });
    const took: number[] = [];
    for (const seconds of [11.05, 6.15, 8.75]) {
      const begin = performance.now();
      await seek(element, seconds);
      took.push(performance.now() - begin);
    }
    console.log(`cold seeks at 20 Mbit/s: ${took.map((ms) => ms.toFixed(0)).join(', ')} ms`);
    await showsAlone(element, 87);
    assert(Math.min(...took) < 1_000, `${took.join(', ')} ms`);
  });

  it('servers that send whole files only play it, too', async () => {
    const element = await showLoaded({ src: `${CLIP}?whole` });
    await seek(element, 0.75);
    await showsAlone(element, 7);
  });

  it('a file that a visitor chose plays', async () => {
    const file = await (await fetch(CLIP)).blob();
    const element = await showLoaded({ src: `${URL.createObjectURL(file)}#ball.gsv` });
    await seek(element, 0.95);
    await showsAlone(element, 9);
  });

  it('a .4dgs file plays, and the work of the page for a frame is short', async () => {
    const archive = new Uint8Array(await (await fetch('/tests/fixtures/4dgs/corpus.zip')).arrayBuffer());
    const file = new Blob([new Uint8Array(unzipSync(archive)[`${MOVING}.4dgs`])]);
    const { AnimatedGaussians } = await import('@gaussian-splat/renderer');
    const { show: showFrame } = AnimatedGaussians.prototype;
    const took: number[] = [];
    AnimatedGaussians.prototype.show = function (...frame) {
      const begin = performance.now();
      showFrame.apply(this, frame);
      took.push(performance.now() - begin);
    };
    try {
      const camera = { 'camera-orbit': '0deg 90deg 9m', 'camera-target': '1.5 0.5 0', 'min-field-of-view': '10deg' };
      const element = await showLoaded({ src: `${URL.createObjectURL(file)}#moving.4dgs`, ...camera });
      assertEqual(element.duration, 4, 'duration');
      const across: number[] = [];
      for (const seconds of [0.02, 1.02, 2.02]) {
        await seek(element, seconds);
        await atRest(element);
        across.push((await screenOf(element)).middleOf(([r, , b]) => r > b + 40)!.x);
      }
      // The object goes one unit to the right in a second, and turns about its axis.
      assert(across[0] < across[1] && across[1] < across[2], `middles at ${across.join(', ')}`);
    } finally {
      AnimatedGaussians.prototype.show = showFrame;
    }
    took.sort((a, b) => a - b);
    console.log(`page's work for a frame of a clip: ${took.map((ms) => ms.toFixed(2)).join(', ')} ms`);
    assert(took[took.length >> 1] < 5, `${took.join(', ')} ms`);
  });

  it('a group that cannot be had is told of once, and passed over', async () => {
    const element = show({ src: `${CLIP}?lost=1` });
    let errors = 0;
    element.addEventListener('generator-error', () => errors++);
    await element.ready;
    const ended = nextEvent(element, 'ended');
    await element.play();
    await ended;
    // The image of before fades out.
    await atRest(element);
    await showsAlone(element, 11);
    assertEqual(errors, 1, 'errors');
  });

  it('what is no clip is an error with a name', async () => {
    const element = show({ src: '/net/slow/cube.ply#x' });
    element.src = URL.createObjectURL(new Blob([new Uint8Array(100)])) + '#other.gsv';
    await nextEvent(element, 'error');
    assertEqual(element.error?.code, 'decode', 'code');
    assert(/a clip/.test(element.error?.message ?? ''), element.error?.message ?? 'no message');
  });

  it('plays in a <splat-scene>, several of them by clocks of their own', async () => {
    const element = await showLoaded({ src: COMPASS });
    const [first, second] = ['-0.4 0 0', '0.4 0 0'].map((position) => {
      const child = document.createElement('splat-scene');
      child.setAttribute('src', CLIP);
      child.setAttribute('position', position);
      element.append(child);
      return child as HTMLElement & {
        loaded: boolean;
        duration: number;
        currentTime: number;
        play(): Promise<void>;
        pause(): void;
      };
    });
    await until(() => first.loaded && second.loaded, 'both clips');
    assertEqual([first.duration, second.duration], [1.2, 1.2], 'durations');
    assertEqual(element.duration, 1.2, 'clips without a clock of their own follow that of the element');
    first.currentTime = 0.95;
    await until(() => first.currentTime === 0.95 && second.currentTime === 0, 'a clock of its own');
    await second.play();
    await until(() => second.currentTime > 0.3, 'the second one plays');
    second.pause();
    assertEqual(first.currentTime, 0.95, 'the first one stands');
  });
});
