/** Less of a scene, at the page's wish, and all of it back again. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { assert, assertEqual, claimFault, frames, show, showLoaded, until } from './support/harness.js';

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

  it('what is no economy is said once, and the scene stays whole', async () => {
    const element = await showLoaded({ economy: 'little' });
    const { splats } = element.statistics!;
    await frames(10);
    await until(() => true, 'a moment');
    element.requestUpdate();
    await frames(10);
    assertEqual(element.statistics?.splats, splats, 'splats');
    claimFault(/economy expects a share such as 60% or dB such as 57db, found "little"/);
  });

  it('a scene that is taken away while it is looked at leaves nothing behind', async () => {
    const element = show({ src: BALL, economy: '50%' });
    await element.ready;
    element.src = null;
    await frames(30);
    assertEqual(element.stats, null, 'stats');
  });
});
