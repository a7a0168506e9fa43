/** Less of a scene, at the page's wish, and all of it back again. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  claimFault,
  devices,
  frames,
  nextEvent,
  show,
  showLoaded,
  until,
} from './support/harness.js';

/** So many splats. */
const BALL = '/net/ball/red.splat?ms=0&n=600';

const bytesOf = async (element: GaussianSplatElement): Promise<string> => {
  const bytes = new Uint8Array(await (await element.toBlob()).arrayBuffer());
  return bytes.join();
};

describe('economy', () => {
  it('shows the whole first, then what is asked for; without the attribute all is back, byte for byte and without a fetch', async () => {
    const element = show({ src: BALL, economy: '60%' });
    await element.ready;
    assertEqual(element.statistics?.splats, 600, 'at first');
    const whole = await bytesOf(element);
    const start = performance.now();
    await until(() => element.stats?.spared === 240, 'two fifths less', 100_000);
    console.log(`60 % of 600 splats after ${(performance.now() - start).toFixed(0)} ms`);
    const { modelled, inMemory, why = [] } = element.stats!;
    assertEqual([modelled, inMemory, element.statistics?.splats], [600, 360, 360], 'modelled, in memory');
    assert(
      why.some((sentence) => /240 splats/.test(sentence)),
      `says ${why.join(' ')}`,
    );
    const fewer = await bytesOf(element);
    assert(fewer !== whole, 'another picture');

    let progress = 0;
    element.addEventListener('progress', () => progress++);
    const requests = performance.getEntriesByType('resource').length;
    element.economy = '20%';
    await until(() => element.stats?.inMemory === 120, 'less still');
    element.economy = null;
    await until(() => element.stats?.inMemory === 600, 'all');
    assertEqual(await bytesOf(element), whole, 'the picture of all');
    assertEqual([progress, performance.getEntriesByType('resource').length], [0, requests], 'progress, requests');
    assertEqual(
      element.stats?.why.filter((sentence) => /splats/.test(sentence)),
      [],
      'nothing is left out',
    );
  }).timeout(120_000);

  it('of views: pictures at rest are whole, moving ones leave out what does not show from their side; without the attribute the sets are freed', async () => {
    const element = show({ src: `${BALL}&size=0.2`, economy: 'views' });
    await element.ready;
    const whole = await bytesOf(element);
    const before = element.stats!.bytes.scene;
    await until(
      () => element.stats!.why.some((sentence) => /do not show from their side/.test(sentence)),
      'sets',
      100_000,
    );
    const { spared, modelled, inMemory, bytes, decibels } = element.stats!;
    assertEqual([spared, modelled, inMemory], [0, 600, 600], 'spared, modelled, in memory');
    assert(decibels !== null && decibels > 55, `${decibels} dB`);
    assert(bytes.scene >= before + 16 * 600, `sets take ${bytes.scene - before} bytes`);
    assertEqual(await bytesOf(element), whole, 'the whole picture');
    const all = (await element.updateStats())!.drawn!;
    element.quality = 'balanced';
    await frames(10);
    const some = (await element.updateStats())!.drawn!;
    assert(some > 0 && some < 0.9 * all, `${some} of ${all} splats drawn`);
    element.quality = 'auto';
    element.economy = '60%';
    await until(() => element.stats!.spared === 240, 'a share in place of them', 100_000);
    element.economy = null;
    await until(() => element.stats!.bytes.scene === before, 'neither');
    assertEqual(await bytesOf(element), whole, 'the picture of all');
  }).timeout(240_000);

  it('what is no economy is said once, and the scene stays whole', async () => {
    const element = await showLoaded({ economy: 'little' });
    const { splats } = element.statistics!;
    // All of it is no fault: sliders end there.
    await showLoaded({ economy: '100%' });
    await frames(10);
    await until(() => true, 'a moment');
    element.requestUpdate();
    await frames(10);
    assertEqual(element.statistics?.splats, splats, 'splats');
    claimFault(/economy expects a share such as 60%, dB such as 57db, or views, found "little"/);
  });

  it('a device that is lost while the scene is looked at, or later, takes nothing with it: no word of it, and then less of the scene again', async () => {
    const element = show({ src: BALL, economy: '60%' });
    await element.ready;
    await frames(20);
    for (const state of ['at once', 'later']) {
      devices[devices.length - 1].destroy();
      await nextEvent(element, 'contextrestored');
      assertEqual([element.stats?.modelled, element.stats?.inMemory], [600, 600], `${state}: at first`);
      await until(() => element.stats?.inMemory === 360, `${state}: less again`, 100_000);
      assertEqual([element.stats?.modelled, element.stats?.spared], [600, 240], `${state}: of all`);
    }
    element.economy = '1';
    await until(() => element.stats?.inMemory === 600, 'all of it');
  }).timeout(240_000);

  it('a scene that is taken away while it is looked at leaves nothing behind', async () => {
    const element = show({ src: BALL, economy: '50%' });
    await element.ready;
    element.src = null;
    await frames(30);
    assertEqual(element.stats, null, 'stats');
  });
});
