/** Loading a large scene: early previews, and the cost for the page. */
import '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  devices,
  frames,
  nextEvent,
  show,
  showLoaded,
  until,
} from './support/harness.js';
import { isRed, screenOf } from './support/screen.js';

/** Splats of the ball that the server creates. */
const SLOW_SPLATS = 4_000;
const SCENE = '/net/shared/scenes/playbot-streamed/0_0/meta.json';

/** Waits until the submitted work is done. */
const gpuIdle = (): Promise<undefined> => devices[devices.length - 1].queue.onSubmittedWorkDone();

/** The longest task of the main thread in ms; tasks under 50 ms are not reported. */
function watchThread(): () => Promise<number> {
  let longest = 0;
  const observer = new PerformanceObserver((list) => {
    for (const { duration } of list.getEntries()) longest = Math.max(longest, duration);
  });
  observer.observe({ entryTypes: ['longtask'] });
  return async () => {
    // Entries come some time after the task.
    await delay(500);
    observer.disconnect();
    return longest;
  };
}

describe('visible previews', () => {
  // Worker, device and pipelines are loaded before the measurement starts.
  beforeEach(async () => void (await showLoaded({ src: '/tests/element/browser/fixtures/compass.ply' })));

  it('of 500,000 splats is shown within a third of the time; the page is never blocked, and the camera never jumps', async function () {
    if (!(await fetch(SCENE)).ok) return this.skip();
    // The best of three: other work on the machine comes and goes.
    let best = { share: Infinity, longestTask: Infinity };
    for (let round = 0; round < 3 && !(best.share <= 1 / 3 && best.longestTask < 50); round++) {
      const longestTask = watchThread();
      const element = show({ src: SCENE });
      const events: string[] = [];
      const radii: number[] = [];
      let loads = 0;
      element.addEventListener('camera-change', () => radii.push(element.getCameraOrbit().radius));
      element.addEventListener('progress', () => events.push(element.matches(':state(preview)') ? 'preview' : 'bytes'));
      element.addEventListener('load', () => loads++);
      await nextEvent(element, 'loadstart');
      const start = performance.now();
      const preview = nextEvent<CustomEvent<{ splats: number }>>(element, 'preview', 50_000);
      const seen = await Promise.race([preview, element.ready]);
      // If less than half a second remains, there is no preview.
      if (!seen) {
        preview.catch(() => undefined);
        element.remove();
        await gpuIdle();
        continue;
      }
      const { detail } = seen;
      const first = performance.now() - start;
      assert(detail.splats > 10_000 && detail.splats < 500_000, `${detail.splats} splats`);
      await until(() => element.stats?.isPreview === true, 'statistics of the preview');
      const { isPreview, reasons = [] } = element.stats ?? {};
      assert(isPreview && reasons.some((sentence) => /part/.test(sentence)), `stats say ${reasons.join(' ')}`);
      assert(!element.loaded && element.revealed && element.matches(':state(preview)'), 'visible, and not loaded');
      await element.toBlob().then(
        () => assert(false, 'no frame of a preview'),
        (error: DOMException) => assertEqual(error.name, 'InvalidStateError', 'why there is none'),
      );
      await element.ready;
      const total = performance.now() - start;
      assertEqual([element.loaded, element.stats?.splats, loads], [true, 500_000, 1], 'the whole');
      assert(!element.matches(':state(preview)'), 'no preview any more');
      best = { share: first / total, longestTask: await longestTask() };
      console.log(
        `first frame after ${first.toFixed(0)} of ${total.toFixed(0)} ms; longest task ${best.longestTask.toFixed(0)} ms`,
      );
      const steps = radii.slice(1).map((radius, i) => Math.abs(Math.log(radius / radii[i])));
      assert(Math.max(0, ...steps) < 0.05, `the distance changed by ${Math.max(...steps)} at once`);
      element.remove();
      await gpuIdle();
    }
    if (best.share === Infinity) return this.skip();
    assert(best.share <= 1 / 3, `a frame after ${best.share} of the time`);
    assert(best.longestTask < 50, `a task of ${best.longestTask} ms on the main thread`);
  }).timeout(120_000);

  it('a slow file is seen part by part, and the whole stands where it would have stood', async () => {
    const element = show({ src: '/net/ball/red.splat?ms=4000' });
    const { detail } = await nextEvent<CustomEvent<{ splats: number }>>(element, 'preview');
    assert(detail.splats < SLOW_SPLATS, `${detail.splats} splats at first`);
    assert((await screenOf(element)).middleOf(isRed) !== null, 'an image');
    await element.ready;
    assertEqual(element.stats?.splats, SLOW_SPLATS, 'the whole');
    const direct = await showLoaded({ src: '/net/ball/red.splat?ms=0' });
    await delay(1_000);
    const [found, expected] = [element, direct].map((each) => `${each.getCameraOrbit()} ${each.getCameraTarget()}`);
    assertEqual(found, expected, 'camera');
  });

  it('a slow file with loading="eager" is seen part by part, too', async () => {
    const element = show({ src: '/net/ball/red.splat?ms=4000&eager', loading: 'eager' });
    const seen = await Promise.race([nextEvent<CustomEvent<{ splats: number }>>(element, 'preview'), element.ready]);
    assert(seen && seen.detail.splats < SLOW_SPLATS, 'a preview before the whole');
    await element.ready;
    assertEqual(element.stats?.splats, SLOW_SPLATS, 'the whole');
  });

  it('a person who moves the camera in a preview keeps the place', async () => {
    const element = show({
      src: '/net/ball/red.splat?ms=4000&again',
      'camera-controls': '',
      'interpolation-decay': '0',
    });
    await nextEvent(element, 'preview');
    await frames(2);
    element.focus();
    const start = element.getCameraOrbit().theta;
    const view = element.shadowRoot!.querySelector('#view')!;
    // The controls are loaded beside the file.
    await until(() => {
      view.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft', bubbles: true }));
      return element.getCameraOrbit().theta !== start;
    }, 'a turn');
    assert(!element.loaded, 'still a preview');
    await frames(2);
    const place = `${element.getCameraOrbit()} ${element.getCameraTarget()}`;
    await element.ready;
    await frames(3);
    assertEqual(`${element.getCameraOrbit()} ${element.getCameraTarget()}`, place, 'camera');
  });

  it('a small file has no preview', async () => {
    const element = show({ src: COMPASS });
    let previews = 0;
    element.addEventListener('preview', () => previews++);
    await element.ready;
    assertEqual(previews, 0, 'previews');
  });
});
