/** The first page: tabs, the copied view, errors for people. Its scene is a small one here; pages.test.ts waits for the real one. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { checkPage } from './page-check.js';
import { isBuilt, openSite, root, withCompass, withScenesToCome, type OpenSite, type Visit } from './support.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
  getCameraOrbit(): { readonly theta: number; readonly phi: number };
  jumpCameraToGoal(): void;
}
const TIMEOUT = { timeout: 100_000, polling: 100 };

/** Sum of all layout shifts of a page until now. */
const shiftsOf = (tab: Page): Promise<number> =>
  tab.evaluate(
    () =>
      new Promise<number>((resolve) => {
        let sum = 0;
        new PerformanceObserver((list) => {
          for (const entry of list.getEntries()) sum += (entry as PerformanceEntry & { value: number }).value;
        }).observe({ type: 'layout-shift', buffered: true });
        setTimeout(() => resolve(sum), 300);
      }),
  );

describe('the first page', { skip: isBuilt ? false : 'no site: npm run build' }, () => {
  let open: OpenSite;
  let only: Visit;
  before(async () => {
    open = await openSite();
    only = await open.visit('/', { prepare: withCompass });
  });
  after(() => open.close());

  it('does not move when the scene comes', async () => {
    const { tab } = only;
    await tab.waitForFunction(() => document.querySelector<Splat>('#hero')!.loaded, undefined, TIMEOUT);
    const shifts = await shiftsOf(tab);
    assert.ok(shifts < 0.01, `cumulative layout shift ${shifts}`);
  });

  it('does not move when an app of React or Vue starts', async () => {
    for (const path of ['/react/', '/vue/']) {
      const { tab } = await open.visit(path, { width: 1280, prepare: withScenesToCome });
      await tab.waitForFunction(() => document.querySelector('#app gaussian-splat:defined'), undefined, TIMEOUT);
      const shifts = await shiftsOf(tab);
      await tab.close();
      assert.ok(shifts < 0.01, `${path}: cumulative layout shift ${shifts}`);
    }
  });

  it('shows its words and chips in the first screen, and never over the middle of the scene', async () => {
    const { tab } = only;
    for (const [width, height] of [
      [390, 844],
      [1024, 768],
      [1280, 800],
      [2560, 1440],
    ]) {
      await tab.setViewportSize({ width, height });
      const found = await tab.evaluate(() => {
        const { left, top, width, height } = document.querySelector('#hero')!.getBoundingClientRect();
        const chips = document.querySelector('.chips')!.getBoundingClientRect();
        const middle = document.elementFromPoint(left + width / 2, Math.min(innerHeight - 1, top + height / 2));
        return { middle: middle?.id, below: chips.bottom - innerHeight, aspect: width / height };
      });
      assert.equal(found.middle, 'hero', `${width} x ${height}`);
      assert.ok(found.below <= 0, `${width} x ${height}: chips end ${found.below} pixels below the window`);
      // The poster is as wide: a wider scene would show what it lacks.
      assert.ok(found.aspect <= (width <= 640 ? 1.001 : 2.201), `${width} x ${height}: ${found.aspect}`);
    }
    await tab.setViewportSize({ width: 390, height: 800 });
  });

  it('copies the view that a visitor has turned to', async () => {
    const { tab, faults } = only;
    await tab.waitForFunction(() => document.querySelector<Splat>('#hero')!.loaded, undefined, TIMEOUT);
    await tab.evaluate(() => document.querySelector<Splat>('#hero')!.focus());
    await tab.keyboard.press('ArrowRight');
    const orbit = await tab.evaluate(() => {
      const hero = document.querySelector<Splat>('#hero')!;
      hero.jumpCameraToGoal();
      const { theta, phi } = hero.getCameraOrbit();
      return [theta, phi].map((radians) => `${Number(((radians * 180) / Math.PI).toFixed(2))}deg`).join(' ');
    });
    await tab.click('#copy-view');
    assert.ok((await tab.locator('#snippet').textContent())!.includes(`camera-orbit="${orbit} `));
    await tab.waitForFunction(() => document.querySelector('#copied')!.textContent !== '', undefined, TIMEOUT);
    assert.deepEqual(faults, []);
  });

  it('lets the wheel scroll the page, also over the scene', async () => {
    const { tab } = only;
    const { x, y, width, height } = (await tab.locator('#hero').boundingBox())!;
    await tab.mouse.move(x + width / 2, y + height / 2);
    await tab.mouse.wheel(0, 200);
    await tab.waitForFunction(() => scrollY > 0, undefined, TIMEOUT);
    await tab.evaluate(() => scrollTo(0, 0));
  });

  it('has tabs that the arrows lead through', async () => {
    const { tab, faults } = only;
    await tab.focus('#tab-html');
    await tab.keyboard.press('ArrowLeft');
    const shown = await tab.locator('[role=tabpanel]:visible').evaluateAll((all) => all.map(({ id }) => id));
    assert.deepEqual(shown, ['panel-vue']);
    assert.equal(await tab.evaluate(() => document.activeElement!.id), 'tab-vue');
    assert.equal(await tab.getAttribute('#tab-vue', 'aria-selected'), 'true');
    assert.deepEqual(faults, []);
  });

  it('has chips that act on its scene, and take it back', async () => {
    const { tab, faults } = only;
    for (const [chip, attribute] of [
      ['measure', 'measure'],
      ['walk', 'navigation'],
    ]) {
      await tab.click(`[data-chip=${chip}]`);
      await tab.waitForFunction((name) => document.querySelector('#hero')!.hasAttribute(name), attribute, TIMEOUT);
      assert.match((await tab.locator('#snippet').textContent())!, new RegExp(`\\b${attribute}\\b`));
    }
    assert.equal(await tab.locator('#hero').getAttribute('measure'), null);
    await tab.click('[data-chip=play]');
    await tab.waitForFunction(
      () => document.querySelector<Splat>('#hero > splat-scene')?.loaded === true,
      undefined,
      TIMEOUT,
    );
    await tab.click('[data-chip=play]');
    assert.equal(await tab.locator('#hero > splat-scene').count(), 0);
    assert.equal(await tab.locator('.chips [aria-pressed=true]').count(), 0);
    assert.deepEqual(faults, []);
  });

  it('is a page as every other', () => checkPage(only));

  it('copies the name of the file that a visitor has opened', async () => {
    const { tab } = only;
    await tab.click('#tab-html');
    await tab.setInputFiles('input[type=file]', join(root, 'tests/element/browser/fixtures/compass.ply'));
    await tab.waitForFunction(
      () => /\d splats/.test(document.querySelector('#own-status')!.textContent!),
      undefined,
      TIMEOUT,
    );
    for (const button of ['#copy-view', '#copy-page']) {
      await tab.click(button);
      await tab.waitForFunction(
        () => /Put compass.ply beside/.test(document.querySelector('#copied')!.textContent!),
        undefined,
        TIMEOUT,
      );
      const html = (await tab.locator('#snippet').textContent())!;
      assert.match(html, /src="compass\.ply" alt="compass\.ply"/);
      assert.doesNotMatch(html, /apartment/);
    }
  });
});
