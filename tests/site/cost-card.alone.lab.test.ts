/** A cost card shows this machine's measurements; the page without WebGPU shows the known facts. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import { statSync } from 'node:fs';
import { checkPage } from './page-check.js';
import { isBuilt, openSite, root, type OpenSite } from './support.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
  readonly ready: Promise<void>;
  readonly currentTime: number;
  readonly error: { readonly reason: string } | null;
  readonly stats: { readonly renderer: string } | null;
}
const TIMEOUT = { timeout: 100_000, polling: 100 };

describe('cards and fallbacks', { skip: isBuilt ? false : 'no site: npm run build' }, () => {
  let open: OpenSite;
  before(async () => (open = await openSite()));
  after(() => open.close());

  // SwiftShader needs a third of a minute for it.
  const skip = process.env.SITE === 'full' ? false : 'only with SITE=full: npm run test:site';
  it('bytes of the file, the first frame, memory and milliseconds', { skip, timeout: 200_000 }, async () => {
    const { tab, faults } = await open.visit('/examples/?frames=3', { width: 240, height: 300 });
    const card = tab.locator('[data-example=file]');
    await card.locator('gaussian-splat').scrollIntoViewIfNeeded();
    await tab.waitForFunction(
      () => document.querySelector<Splat>('[data-example=file] gaussian-splat')!.loaded,
      undefined,
      TIMEOUT,
    );
    const megabytes = (statSync(`${root}demo/scenes/skull.spz`).size / 1e6).toFixed(2);
    const before = (await card.locator('.cost').textContent())!;
    assert.ok(before.includes(`${megabytes} MB, SPZ`), before);
    assert.match(before, /First frameafter [\d.]+ m?s, hereGPU memory5\.6 MB/);
    await card.getByRole('button', { name: 'Measure here' }).click();
    await card.getByRole('button', { name: 'Again' }).waitFor({ timeout: 100_000 });
    assert.match((await card.locator('.cost').textContent())!, /[\d.]+ ms at \d+ × \d+, median of \d+, on \w+/);
    assert.deepEqual(faults, []);
    await tab.close();
  });

  it('a sequence plays, and pauses where its slider is moved', { skip, timeout: 200_000 }, async () => {
    const { tab, faults } = await open.visit('/examples/', { width: 800, height: 600 });
    const card = tab.locator('[data-example=sequence]');
    const scene = card.locator('gaussian-splat');
    await scene.scrollIntoViewIfNeeded();
    await scene.evaluate((element: Splat) => element.ready);
    await card.getByRole('button', { name: 'Play' }).click();
    await tab.waitForFunction(
      () => document.querySelector<Splat>('[data-example=sequence] gaussian-splat')!.currentTime > 0.3,
      undefined,
      TIMEOUT,
    );
    await card.locator('[data-time]').fill('1');
    await card.getByRole('button', { name: 'Play' }).waitFor();
    assert.equal(await scene.evaluate((element: Splat) => element.currentTime), 1);
    assert.deepEqual(faults, []);
    await tab.close();
  });

  // Their networks take too long on SwiftShader for a test: the scene is visible while the first frame is drawn.
  for (const name of ['oil', 'denoise']) {
    it(`${name}: a click replaces the image by the scene`, { skip, timeout: 200_000 }, async () => {
      const { tab, faults } = await open.visit('/examples/', { width: 240, height: 300 });
      const card = tab.locator(`[data-example=${name}]`);
      await card.locator('.cost dd').first().waitFor();
      await card.locator('[data-paint]').click();
      await card.locator('gaussian-splat').evaluate((element: Splat) => element.ready);
      assert.equal(await card.locator('gaussian-splat').evaluate((element: Splat) => element.loaded), true);
      assert.deepEqual(
        [await card.locator('img').count(), await card.locator('.words [role=status]').textContent()],
        [0, ''],
      );
      assert.deepEqual(faults, []);
      await tab.close();
    });
  }

  it('without WebGPU: WebGL draws, or a sentence says why not, or the fallback of the page', async () => {
    const { tab, faults } = await open.visit('/without-webgpu/', {});
    await tab.waitForFunction(() =>
      [...document.querySelectorAll<Splat>('gaussian-splat')].every(({ loaded, error }) => loaded || !!error),
    );
    const reasons = await tab.evaluate(() =>
      [...document.querySelectorAll<Splat>('gaussian-splat')].map(
        ({ error, stats }) => error?.reason ?? stats!.renderer,
      ),
    );
    assert.deepEqual(reasons, ['webgl', 'unsupported/no-webgpu', 'unsupported/no-webgpu']);
    assert.ok(await tab.locator('#plain p').getByText('This 3D scene needs WebGPU').isVisible());
    assert.ok(await tab.locator('figure[slot=fallback]').getByText('An image of the scene').isVisible());
    await checkPage({ tab, faults });
    await tab.close();
  });
});
