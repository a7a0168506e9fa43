/**
 * Clips: one file that is played by byte ranges, with the words of HTMLMediaElement.
 * SECURITY.md: "Files that change are not mixed".
 */
import '@gaussian-splat/element';
import { unzipSync } from 'fflate';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import {
  assert,
  assertEqual,
  atRest,
  COMPASS,
  delay,
  gated,
  nextEvent,
  show,
  showLoaded,
  until,
} from './support/harness.js';
import { isBlue, isGreen, isRed, screenOf, type Rgb } from './support/screen.js';

const CLIP = '/net/clip/ball.gsv';
/** A clip of the conformance corpus: an object of six splats that moves and turns. */
const MOVING = 'object/ObjectTrackComposed-UseChunkIndex-UseCrc';

async function shows(element: GaussianSplatElement, isColor: (color: Rgb) => boolean): Promise<boolean> {
  return (await screenOf(element)).middleOf(isColor) !== null;
}

async function seek(element: GaussianSplatElement, seconds: number): Promise<void> {
  const seeked = nextEvent(element, 'seeked');
  element.currentTime = seconds;
  assert(element.seeking, 'seeking');
  await seeked;
}

async function showsAlone(element: GaussianSplatElement, frame: number): Promise<void> {
  const colors = [isRed, isGreen, isBlue];
  for (const [k, isColor] of colors.entries())
    assertEqual(await shows(element, isColor), k === frame % 3, `color ${k} in frame ${frame}`);
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

  it('does not start after pause(), also while it is loading', async () => {
    const element = show({ src: CLIP, autoplay: '' });
    await element.updateComplete;
    element.pause();
    await element.ready;
    await until(() => element.revealed, 'the scene');
    await delay(200);
    assertEqual([element.loaded, element.paused, element.currentTime], [true, true, 0], 'loaded, paused, time');
    await element.play();
    await until(() => element.currentTime > 0, 'a script starts it');
    element.setAttribute('renderer', 'webgpu');
    element.pause();
    await element.updateComplete;
    await until(() => element.loaded, 'the scene again');
    await delay(200);
    assertEqual([element.paused, element.currentTime], [true, 0], 'paused and time after another attribute');
  });

  it('what a script says just after another src is about that scene, and what it said before is not', async () => {
    const element = await showLoaded({ src: CLIP, autoplay: '' });
    const child = document.createElement('splat-scene');
    child.setAttribute('autoplay', '');
    child.setAttribute('src', CLIP);
    element.append(child);
    await until(() => element.currentTime > 0 && child.currentTime > 0, 'both play');
    for (const each of [element, child]) {
      each.src = `${CLIP}?frames=8`;
      each.pause();
      each.currentTime = 0.35;
    }
    for (const each of [element, child])
      await until(() => each.loaded && each.duration === 0.8, `the next scene of ${each.localName}`);
    await delay(300);
    for (const { localName, paused, currentTime } of [element, child])
      assertEqual([paused, currentTime], [true, 0.35], `paused and time of ${localName}`);
    element.src = child.src = CLIP;
    await until(() => element.currentTime > 0.4 && child.currentTime > 0.4, 'later scenes to play automatically');
    const played = element.play().catch(({ name }: Error) => name);
    element.src = `${CLIP}?frames=8`;
    assertEqual(await played, 'AbortError', 'a promise of the scene before');
  });

  it('stands while its element has no height', async () => {
    const element = await showLoaded({ src: CLIP });
    await element.play();
    await until(() => element.currentTime > 0.1, 'it plays');
    element.style.height = '0';
    await delay(200);
    const { currentTime } = element;
    await delay(800);
    element.style.height = '100px';
    const before = await new Promise<number>((resolve) =>
      element.addEventListener('timeupdate', () => resolve(element.currentTime), { once: true }),
    );
    assert(before < currentTime + 0.6, `from ${currentTime} to ${before} s in no time`);
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

  itInLab('waits for frames in transit, also after a late frame, and continues from there', async () => {
    const gate = `clip-${Math.round(performance.timeOrigin)}`;
    const element = await showLoaded({ src: `${CLIP}?gate=${gate}` });
    const said: string[] = [];
    for (const type of ['waiting', 'canplay', 'playing', 'ended'])
      element.addEventListener(type, () => said.push(`${type} ${element.currentTime.toFixed(1)}`));
    await element.play();
    await until(() => said.includes('playing 0.0'), 'it plays');
    // Longer than the whole clip.
    for (const end = performance.now() + 1500; performance.now() < end;);
    await until(() => said.length > 1, 'it waits');
    assertEqual(said, ['playing 0.0', 'waiting 0.4'], 'events of a clip whose second group is missing');
    assertEqual([element.readyState, element.currentTime], [2, 0.4], 'readyState, currentTime');
    await fetch(`/net/open/${gate}`);
    await until(() => said.some((each) => each.startsWith('ended')), 'it continues to the end');
    const order = said.map((each) => each.split(' ')[0]);
    assertEqual(order.slice(0, 4), ['playing', 'waiting', 'canplay', 'playing'], 'events');
  });

  itInLab('that is replaced on its server while it plays continues with the new version', async () => {
    const gate = `replaced-${Math.round(performance.timeOrigin)}`;
    const element = await showLoaded({ src: `${CLIP}?frames=84&replaced=${gate}` });
    assertEqual(element.duration, 8.4, 'duration');
    const said: string[] = [];
    for (const type of ['error', 'generator-error', 'emptied', 'load', 'durationchange'])
      element.addEventListener(type, () => said.push(type));
    await fetch(`/net/open/${gate}`);
    await seek(element, 8.35);
    await until(() => element.duration === 9.6, 'the version of 12 frames more');
    assertEqual([element.currentTime, element.loaded], [8.35, true], 'currentTime, loaded');
    await until(() => spansOf(element).some(([start, end]) => start <= 8.35 && end > 8.35), 'the frames of the seek');
    await showsAlone(element, 83);
    await seek(element, 9.55);
    await showsAlone(element, 95);
    assertEqual(said, ['durationchange'], 'events');
  });

  it('whose server gives every answer another version ends in a named error, after a few requests', async () => {
    const element = await showLoaded({ src: `${CLIP}?frames=84&alternating=17` });
    const failed = nextEvent<CustomEvent<{ reason: string }>>(element, 'generator-error');
    element.currentTime = 8.35;
    assertEqual((await failed).detail.reason, 'network/changed', 'reason');
    assert(element.loaded, 'the clip stays');
    const other = show({ src: `${CLIP}?frames=84&alternating=0` });
    await until(() => other.error !== null, 'an error');
    assertEqual(other.error!.reason, 'network/changed', 'reason of a clip that never opens');
  });

  itInLab('a seek into what is there takes the time of a frame, and no task of the page is long', async () => {
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
    const gate = `seek-${performance.timeOrigin}`;
    const element = await showLoaded({ src: `${CLIP}?gate=${gate}` });
    const arrived: number[] = [];
    element.addEventListener('progress', ({ loaded, total }) => arrived.push(loaded / total));
    const seeked = seek(element, 1.05);
    assertEqual(element.readyState, HTMLMediaElement.HAVE_METADATA, 'readyState');
    await fetch(`/net/open/${gate}`);
    await seeked;
    assert(arrived.length > 0 && arrived.every((share) => share > 0 && share <= 1), `progress ${arrived.join(', ')}`);
    await showsAlone(element, 10);
  });

  itInLab('a seek into what has not come takes half a second at 20 Mbit/s', async () => {
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

  itInLab('a missing group is reported once, and skipped', async () => {
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

  it('in a <splat-scene> stops at the visible frame if a script pauses it, and the others continue', async () => {
    const element = await showLoaded({ src: COMPASS, loop: '' });
    element.insertAdjacentHTML('beforeend', `<splat-scene src="${CLIP}"></splat-scene>`.repeat(2));
    const children = [...element.children] as (HTMLElement & { paused: boolean; currentTime: number; pause(): void })[];
    await until(() => element.duration === 1.2, 'the clock of the element');
    await element.play();
    await until(() => element.currentTime > 0.3, 'its time to continue');
    const events: string[] = [];
    children[0].addEventListener('pause', ({ type }) => events.push(type));
    children[0].pause();
    const [paused, other] = children.map(({ currentTime }) => currentTime);
    assert(paused > 0.3 && Math.abs(paused - other) < 1e-9, `${paused} s of ${other} s`);
    assertEqual([children[0].paused, children[1].paused, events], [true, false, ['pause']], 'paused, events');
    await until(() => children[1].currentTime !== other, 'the other one continues');
    assertEqual(children[0].currentTime, paused, 'it stands');
  });

  it('gives its clock to what follows it: not to one that comes while another src loads, and to all once it is removed', async () => {
    const element = await showLoaded({ src: CLIP });
    const { src, open } = gated('compass.ply');
    // A child that loads does not delay the scene that is shown.
    const slow = Object.assign(document.createElement('splat-scene'), { src });
    const loading = nextEvent(slow, 'loadstart');
    element.append(slow);
    await loading;
    await element.play();
    assertEqual(element.paused, false, 'it plays');
    const changes: number[] = [];
    const next = gated('compass.ply');
    element.src = next.src;
    await nextEvent(element, 'emptied');
    element.addEventListener('durationchange', () => changes.push(element.duration));
    const loaded = nextEvent(slow, 'load');
    await open();
    await loaded;
    assertEqual(changes, [], 'durations while the next scene loads');
    await next.open();
    await element.ready;
    const child = Object.assign(document.createElement('splat-scene'), { src: CLIP });
    const comes = nextEvent(child, 'load');
    element.append(child);
    await comes;
    assertEqual(element.duration, 1.2, 'duration of what follows the clock');
    element.src = null;
    await nextEvent(element, 'emptied');
    assertEqual(element.duration, 1.2, 'without a scene of its own');
    await element.play();
    await until(() => element.currentTime > 0, 'the child plays');
  });
});
