/** The comparison: cameras in step, a line that the keyboard moves, pictures that differ by what the selects say. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import type { Page } from 'playwright-core';
import { isBuilt, openSite, type OpenSite } from './support.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
  getCameraOrbit(): object;
}
const PATIENCE = { timeout: 100_000, polling: 100 };

const bothLoaded = (tab: Page): Promise<unknown> =>
  tab.waitForFunction(
    () => [...document.querySelectorAll<Splat>('gaussian-splat')].every(({ loaded }) => loaded),
    undefined,
    PATIENCE,
  );
const orbits = (tab: Page): Promise<string[]> =>
  tab.evaluate(() =>
    [...document.querySelectorAll<Splat>('gaussian-splat')].map((each) => String(each.getCameraOrbit())),
  );

describe('the comparison', { skip: isBuilt ? false : 'no site: npm run build' }, () => {
  let open: OpenSite;
  before(async () => (open = await openSite()));
  after(() => open.close());

  for (const [leader, key] of [
    ['left', 'ArrowRight'],
    ['right', 'ArrowUp'],
  ]) {
    it(`whoever turns the ${leader} picture turns both`, { timeout: 120_000 }, async () => {
      const { tab, faults } = await open.visit('/compare/?src=/fixtures/compass.splat', { width: 320, height: 500 });
      await bothLoaded(tab);
      const [before] = await orbits(tab);
      await tab.evaluate((id) => document.getElementById(id)!.focus(), leader);
      await tab.keyboard.press(key);
      await tab.waitForFunction(
        (old) => {
          const [a, b] = [...document.querySelectorAll<Splat>('gaussian-splat')].map((s) => String(s.getCameraOrbit()));
          return a === b && a !== old;
        },
        before,
        PATIENCE,
      );
      assert.deepEqual(faults, []);
      await tab.close();
    });
  }

  it('the keyboard moves the line, and each picture ends there', { timeout: 60_000 }, async () => {
    const { tab } = await open.visit('/compare/?src=/fixtures/compass.splat');
    await tab.focus('#split');
    for (let i = 0; i < 20; i++) await tab.keyboard.press('ArrowLeft');
    const clips = await tab.evaluate(() =>
      [...document.querySelectorAll('gaussian-splat')].map((each) => getComputedStyle(each).clipPath),
    );
    assert.deepEqual(clips, ['inset(0px 60% 0px 0px)', 'inset(0px 0px 0px 40%)']);
    await tab.close();
  });

  it('measures both, and how far harmonics of degree 0 are from those of degree 2', { timeout: 200_000 }, async () => {
    const { tab, faults } = await open.visit('/compare/?left=default,3&right=default,0&frames=3', {
      width: 240,
      height: 400,
    });
    await bothLoaded(tab);
    await tab.click('#measure');
    await tab.waitForFunction(
      () => document.querySelector('#status')!.textContent !== 'Measuring…',
      undefined,
      PATIENCE,
    );
    assert.match((await tab.locator('#status').textContent())!, /^\d+ × \d+ pixels\.$/);
    const rows = await tab.locator('#figures tbody tr').allTextContents();
    const cells = await tab.locator('#figures tbody tr:first-child td').allTextContents();
    const [decibels, worst] = [Number(cells[2]), Number(cells[3])];
    assert.equal(rows.length, 2);
    assert.ok(Number(cells[1]) > 0, 'it took time');
    assert.ok(decibels > 20 && decibels < 45, `${decibels} dB`);
    assert.ok(worst > 5, `${worst} of 255`);
    assert.deepEqual(faults, []);
    // The same on both sides is the same picture.
    await tab.selectOption('#right-degree', '2');
    await tab.click('#measure');
    await tab.waitForFunction(
      () => document.querySelector('#figures td:nth-child(3)')!.textContent === 'the same',
      undefined,
      PATIENCE,
    );
    await tab.close();
  });
});
