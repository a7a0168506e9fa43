/** Videos: frames of `gaussian-splat video` and of the element are the same, and the browser records the screen. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { executeServerCommand } from '@web/test-runner-commands';
import { itInLab, someOf } from '../../support/extent-in-pages.js';
import { assert, assertEqual, COMPASS, FIXTURES, nextEvent, showLoaded, until } from './support/harness.js';
import { sendTouch } from './support/screen.js';
import { tone } from './support/tone.js';

const PATH = `${FIXTURES}path.json`;
const SIZE = { width: 96, height: 72 };
const STILL = { alt: 'A compass', 'interaction-prompt': 'none', views: PATH };
const STYLE = 'width: 96px; height: 72px';

async function pixelsOf(image: Blob): Promise<Uint8ClampedArray> {
  const bitmap = await createImageBitmap(image);
  const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height).data;
}

/** Frames of the command, in whose arguments paths start at the repository's root. */
async function framesOfCommand(...args: string[]): Promise<Blob[]> {
  const ask = (): Promise<string | string[]> => executeServerCommand<string | string[], string[]>('video-frames', args);
  let found = await ask();
  while (typeof found === 'string') found = await ask();
  return found.map((text) => new Blob([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], { type: 'image/png' }));
}

async function framesOf(images: AsyncIterable<Blob>): Promise<Blob[]> {
  const frames: Blob[] = [];
  for await (const image of images) frames.push(image);
  return frames;
}

/** Greatest difference of two lists of images, in steps of 1/255. */
async function maxDifference(some: readonly Blob[], others: readonly Blob[]): Promise<number> {
  assertEqual(some.length, others.length, 'frames');
  let greatest = 0;
  for (const [i, image] of some.entries()) {
    const [a, b] = await Promise.all([pixelsOf(image), pixelsOf(others[i])]);
    assertEqual(a.length, b.length, 'values of a frame');
    for (let k = 0; k < a.length; k++) greatest = Math.max(greatest, Math.abs(a[k] - b[k]));
  }
  return greatest;
}

const WHITE = ['--background', '1,1,1', '--size', `${SIZE.width}x${SIZE.height}`];
const inRepository = (url: string): string => url.replace(/^\//, '');

describe('the frames of a path', () => {
  const same = async (src: string, frames: number, path: 'views' | 'turntable'): Promise<void> => {
    const way = path === 'views' ? ['--path', inRepository(PATH)] : ['--turntable'];
    const command = framesOfCommand(inRepository(src), ...way, '--frames', `${frames}`, ...WHITE);
    const element = await showLoaded({ ...STILL, src }, STYLE);
    const own = await framesOf(element.recordFrames({ ...SIZE, path, frames, background: 'white' }));
    const difference = await maxDifference(own, await command);
    assert(difference <= 1, `${src}, ${path}: frames differ by ${difference} / 255`);
    const change = await maxDifference(own.slice(0, 1), own.slice(1, 2));
    assert(change > 20, `the camera moves: ${change} / 255`);
  };

  for (const path of someOf(['views', 'turntable'] as const, 1))
    it(`are those of gaussian-splat video: ${path}`, () => same(COMPASS, 6, path));
  itInLab('are so in a video of 120 frames', () => same('/demo/scenes/skull.spz', 120, 'views'));

  it('are those of the element at their times, and leave the camera where it was', async () => {
    const element = await showLoaded(STILL, STYLE);
    const before = element.getCameraOrbit().toString();
    const frames = await framesOf(element.recordFrames({ path: 'views', frames: 4, background: 'white' }));
    assertEqual(element.getCameraOrbit().toString(), before, 'camera');
    const shown: Blob[] = [];
    for (let i = 0; i < 4; i++) {
      await element.seekPath(i / 3);
      shown.push(await element.toBlob({ background: 'white' }));
    }
    assertEqual(await maxDifference(frames, shown), 0, 'difference');
  });

  it('of another shape than the element frame the scene as an element of that shape does', async () => {
    const options = { path: 'turntable', frames: 1, width: 120, height: 60, background: 'white' } as const;
    const [tall, wide] = [
      await showLoaded(STILL, 'width: 60px; height: 120px'),
      await showLoaded(STILL, 'width: 120px; height: 60px'),
    ];
    const [ofTall, ofWide] = [await framesOf(tall.recordFrames(options)), await framesOf(wide.recordFrames(options))];
    assertEqual(await maxDifference(ofTall, ofWide), 0, 'difference');
  });

  it('end where they are to end, and say what they lack', async () => {
    const element = await showLoaded({ ...STILL, views: '[]' }, STYLE);
    for await (const image of element.recordFrames({ path: 'turntable', frames: 100 })) {
      assertEqual(image.type, 'image/png', 'type');
      break;
    }
    const failed = await framesOf(element.recordFrames({ path: 'views' })).catch((error: Error) => error.name);
    assertEqual(failed, 'TypeError', 'without views');
    const endless = await framesOf(element.recordFrames()).catch((error: Error) => error.name);
    assertEqual(endless, 'TypeError', 'without an end');
  });

  it('have their element for themselves: another recording is refused, and works after the first', async () => {
    const element = await showLoaded(STILL, STYLE);
    const named = (recording: Promise<unknown>): Promise<unknown> => recording.catch(({ name }: Error) => name);
    const options = { path: 'turntable', frames: 3, background: 'white' } as const;
    const alone = await framesOf(element.recordFrames(options));
    const images = element.recordFrames(options);
    const frames: Blob[] = [(await images.next()).value as Blob];
    assertEqual(
      await Promise.all([named(framesOf(element.recordFrames(options))), named(element.record({ duration: 50 }))]),
      ['InvalidStateError', 'InvalidStateError'],
      'recordings beside it',
    );
    for await (const image of images) frames.push(image);
    assertEqual(await maxDifference(frames, alone), 0, 'difference to a recording alone');
    const videos = [element.record({ duration: 300 }), element.record({ duration: 300 })].map(named);
    const [first, second] = await Promise.all(videos);
    assert(first instanceof Blob && first.size > 100, 'the first of two videos');
    assertEqual(second, 'InvalidStateError', 'the second');
    assert((await named(element.record({ duration: 100 }))) instanceof Blob, 'one after both');
  });

  it('end with an error if another scene takes the place of one that moves', async () => {
    const element = await showLoaded({ ...STILL, src: '/net/clip/ball.gsv' }, STYLE);
    const images = element.recordFrames({ frames: 10, frameRate: 10 });
    await images.next();
    const next = images.next().catch(({ name }: Error) => name);
    element.src = COMPASS;
    assertEqual(await next, 'InvalidStateError', 'error');
  });
});

describe('record()', () => {
  const play = async (video: Blob): Promise<HTMLVideoElement> => {
    const player = Object.assign(document.createElement('video'), { muted: true, src: URL.createObjectURL(video) });
    document.body.append(player);
    await player.play();
    await until(() => player.currentTime > 0.2, 'frames of the video');
    player.pause();
    return player;
  };
  /** Darkest channel of a corner, and of all pixels. */
  const colorsOf = (player: HTMLVideoElement): { corner: number; darkest: number } => {
    const context = new OffscreenCanvas(player.videoWidth, player.videoHeight).getContext('2d')!;
    context.drawImage(player, 0, 0);
    const { data } = context.getImageData(0, 0, player.videoWidth, player.videoHeight);
    return { corner: Math.min(...data.subarray(0, 3)), darkest: Math.min(...data) };
  };
  const load = (): Promise<GaussianSplatElement> => showLoaded({ ...STILL, 'camera-orbit': '0deg 80deg 60%' }, STYLE);

  it('is a video of the visible frames, which browsers play', async () => {
    const element = await load();
    const before = element.getCameraOrbit().toString();
    const video = await element.record({ path: 'turntable', duration: 600 });
    assert(video.size > 100 && /^video\/(webm|mp4)/.test(video.type), `${video.size} bytes of ${video.type}`);
    assertEqual(element.getCameraOrbit().toString(), before, 'camera');
    const player = await play(video);
    assertEqual([player.videoWidth, player.videoHeight], [96, 72], 'size');
    const { corner, darkest } = colorsOf(player);
    assert(corner > 230 && darkest < 120, `white behind the compass: ${corner}, ${darkest}`);
    player.remove();
  });

  /** Duration of a video in seconds, from its first frame to its last. */
  const durationOf = async (video: Blob): Promise<number> => {
    const player = Object.assign(document.createElement('video'), { muted: true, src: URL.createObjectURL(video) });
    await nextEvent(player, 'loadedmetadata');
    // Recorded files do not state their duration: browsers find it by a seek beyond the end.
    player.currentTime = 1e6;
    await nextEvent(player, 'seeked');
    return player.duration;
  };

  it('is as long as it was asked to be, however long the scene takes for a frame', async () => {
    const element = await load();
    for (const mimeType of ['video/webm;codecs=vp9', 'video/mp4'].filter((type) =>
      MediaRecorder.isTypeSupported(type),
    )) {
      let [drawn, longest, before] = [0, 0, performance.now()];
      const slow = (): void => {
        drawn++;
        for (const end = performance.now() + 250; performance.now() < end;);
      };
      const watch = (): void => {
        const now = performance.now();
        [longest, before] = [Math.max(longest, now - before), now];
        watching = requestAnimationFrame(watch);
      };
      let watching = requestAnimationFrame(watch);
      element.addEventListener('camera-change', slow);
      const video = await element.record({ mimeType, path: 'turntable', duration: 1_500 });
      element.removeEventListener('camera-change', slow);
      cancelAnimationFrame(watching);
      const seconds = await durationOf(video);
      assert(drawn > 0 && drawn < 12, `${drawn} frames of the scene`);
      // A frame of the video less; two frames of the page more, because the last one waits for that which is drawn.
      const max = 1.5 + (2 * longest) / 1000;
      assert(seconds >= 1.5 - 1 / 30 && seconds <= max, `${seconds} s of ${mimeType}, at most ${max}`);
    }
  });

  it('has the sound of the slot, also if it is muted', async () => {
    const element = await showLoaded({ ...STILL, src: '/net/clip/ball.gsv', loop: '' }, STYLE);
    const audio = Object.assign(document.createElement('audio'), { src: tone(1.2), slot: 'sound', muted: true });
    element.append(audio);
    await sendTouch('touchStart', [{ x: 400, y: 400 }]);
    await sendTouch('touchEnd', []);
    await element.play();
    await until(() => !audio.paused && audio.currentTime > 0, 'the sound');
    const video = await element.record({ duration: 1_000 });
    const sound = await new AudioContext().decodeAudioData(await video.arrayBuffer());
    const loudest = sound.getChannelData(0).reduce((max, value) => Math.max(max, Math.abs(value)), 0);
    assert(sound.duration > 0.8 && loudest > 0.02, `${sound.duration} s of sound, at most ${loudest}`);
  });

  it('without a sound has no track for it, and waits for none', async () => {
    const element = await load();
    const video = await element.record({ duration: 300 });
    assert(!/opus|mp4a/.test(video.type), video.type);
  });

  it('ends by a signal, and says what it cannot do', async () => {
    const element = await load();
    const controller = new AbortController();
    setTimeout(() => controller.abort(), 300);
    const video = await element.record({ signal: controller.signal });
    assert(video.size > 100, `${video.size} bytes`);
    const names = await Promise.all(
      [{}, { duration: 9, mimeType: 'video/none' }, { duration: 9, background: 'no color' }].map((options) =>
        element.record(options).catch((error: Error) => error.name),
      ),
    );
    assertEqual(names, ['TypeError', 'NotSupportedError', 'TypeError'], 'errors');
  });
});
