/** Scene files that follow one another in time, with the words of HTMLMediaElement. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, delay, frames, nextEvent, show, showLoaded, until } from './support/harness.js';
import { isBlue, isGreen, isRed, screenOf, type Rgb } from './support/screen.js';

const MOVIE = '/net/sequence/movie.json';

/** Frames in the page's memory or on their way: an inner figure, since nothing else shows that it is bounded. */
const heldFrames = (element: GaussianSplatElement): number =>
  (element as unknown as { stage: { scene: { scene: { live: { heldFrames: number } } } } }).stage.scene.scene.live
    .heldFrames;

async function shows(element: GaussianSplatElement, isColour: (colour: Rgb) => boolean): Promise<boolean> {
  return (await screenOf(element)).middleOf(isColour) !== null;
}

async function seek(element: GaussianSplatElement, seconds: number): Promise<void> {
  const seeked = nextEvent(element, 'seeked');
  element.currentTime = seconds;
  assert(element.seeking, 'seeking');
  await seeked;
  assert(!element.seeking, 'no longer seeking');
}

describe('a sequence of files', () => {
  it('has a duration, shows the frame of every time, also one with more splats than there was room for', async () => {
    const element = await showLoaded({ src: MOVIE });
    assertEqual([element.duration, element.paused, element.currentTime], [1.2, true, 0], 'duration, paused, time');
    assertEqual(element.statistics?.splats, 200, 'splats of the first frame');
    assert(await shows(element, isRed), 'the first frame');
    for (const [seconds, isColour, splats] of [
      [0.15, isGreen, 220],
      [0.25, isBlue, 240],
      [1.15, isBlue, 420],
      [0, isRed, 200],
    ] as const) {
      await seek(element, seconds);
      await until(() => element.statistics?.splats === splats, `${splats} splats at ${seconds} s`);
      assert(await shows(element, isColour), `the frame at ${seconds} s`);
      for (const other of [isRed, isGreen, isBlue]) {
        if (other !== isColour) assert(!(await shows(element, other)), `nothing of other frames at ${seconds} s`);
      }
    }
  });

  it('plays to its end, and over and over with loop', async () => {
    const element = await showLoaded({ src: MOVIE });
    const ended = nextEvent(element, 'ended');
    await element.play();
    await ended;
    assertEqual([element.currentTime, element.ended, element.paused], [1.2, true, true], 'at the end');
    await until(() => element.statistics?.splats === 420, 'the last frame');
    element.loop = true;
    await element.play();
    let wraps = 0;
    let last = element.currentTime;
    await until(() => {
      if (element.currentTime < last) wraps++;
      last = element.currentTime;
      return wraps >= 2;
    }, 'two rounds');
    element.pause();
    await frames(5);
  });

  it('a late frame leaves the last one on show, and is shown when it is there', async () => {
    const element = await showLoaded({ src: `${MOVIE}?ms=1200` });
    element.currentTime = 0.15;
    await delay(300);
    assert(element.seeking && (await shows(element, isRed)), 'the first frame still');
    await until(() => !element.seeking, 'the frame');
    assert(await shows(element, isGreen), 'the second frame');
  });

  it('holds two seconds of frames in memory, whatever its length', async () => {
    const element = await showLoaded({ src: `${MOVIE}?count=300&fps=10` });
    for (const seconds of [0, 5, 29, 12]) {
      await seek(element, seconds);
      await delay(200);
      assert(heldFrames(element) <= 20, `${heldFrames(element)} frames at ${seconds} s`);
    }
    assert(heldFrames(element) > 5, 'and fetches ahead');
  });

  it('a frame that is not there is told once and passed over', async () => {
    const element = show({ src: `${MOVIE}?lost=1` });
    const messages: string[] = [];
    element.addEventListener('generator-error', ({ detail }) => messages.push(detail.reason));
    await element.ready;
    await seek(element, 0.15);
    await seek(element, 0.25);
    assert(await shows(element, isBlue), 'the frame behind it');
    assertEqual(messages, ['network/status'], 'errors');
  });
});
