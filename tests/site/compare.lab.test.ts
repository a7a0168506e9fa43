/** The comparison: cameras in step, a line that the keyboard moves, images that differ by the selected settings. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import type { Page } from 'playwright-core';
import { checkPage } from './page-check.js';
import { isBuilt, openSite, type OpenSite, type Visit } from './support.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
  getCameraOrbit(): object;
}
const TIMEOUT = { timeout: 100_000, polling: 100 };

const bothLoaded = (tab: Page): Promise<unknown> =>
  tab.waitForFunction(
    () => [...document.querySelectorAll<Splat>('gaussian-splat')].every(({ loaded }) => loaded),
    undefined,
    TIMEOUT,
  );
const orbits = (tab: Page): Promise<string[]> =>
  tab.evaluate(() =>
    [...document.querySelectorAll<Splat>('gaussian-splat')].map((each) => String(each.getCameraOrbit())),
  );

/** A ball of splats whose colors change with the direction: harmonics of degree 2, in the layout of INRIA's trainer. */
function glossy(): string {
  const numbered = (name: string, count: number): string[] => Array.from({ length: count }, (_, i) => `${name}_${i}`);
  const colors = [...numbered('f_dc', 3), ...numbered('f_rest', 24)];
  const names = ['x', 'y', 'z', ...colors, 'opacity', ...numbered('scale', 3), ...numbered('rot', 4)];
  const rows = Array.from({ length: 200 }, (_, i) => {
    const place = [Math.sin(7 * i), Math.sin(11 * i), Math.sin(13 * i)];
    return [...place, ...colors.map((_, k) => 0.6 * Math.sin(i + 3 * k)), 2, -1.5, -1.5, -1.5, 1, 0, 0, 0].join(' ');
  });
  const header = [
    'ply',
    'format ascii 1.0',
    `element vertex ${rows.length}`,
    ...names.map((name) => `property float ${name}`),
  ];
  return [...header, 'end_header', ...rows, ''].join('\n');
}

describe('the comparison', { skip: isBuilt ? false : 'no site: npm run build' }, () => {
  let open: OpenSite;
  let visit: Visit;
  before(async () => {
    open = await openSite();
    visit = await open.visit('/compare/?src=/glossy.ply&left=default,3&right=default,0&frames=9', {
      width: 240,
      height: 400,
      prepare: (page) => page.route('**/glossy.ply', (route) => route.fulfill({ body: glossy() })),
    });
  });
  after(() => open.close());

  it('turning one frame turns both, and the keyboard moves the line', { timeout: 120_000 }, async () => {
    const { tab, faults } = visit;
    await bothLoaded(tab);
    for (const [leader, key] of [
      ['left', 'ArrowRight'],
      ['right', 'ArrowUp'],
    ]) {
      const [before] = await orbits(tab);
      await tab.evaluate((id) => document.getElementById(id)!.focus(), leader);
      await tab.keyboard.press(key);
      await tab.waitForFunction(
        (old) => {
          const [a, b] = [...document.querySelectorAll<Splat>('gaussian-splat')].map((s) => String(s.getCameraOrbit()));
          return a === b && a !== old;
        },
        before,
        TIMEOUT,
      );
    }
    await tab.focus('#split');
    for (let i = 0; i < 20; i++) await tab.keyboard.press('ArrowLeft');
    const clips = await tab.evaluate(() =>
      [...document.querySelectorAll('gaussian-splat')].map((each) => getComputedStyle(each).clipPath),
    );
    const { x, y, width } = (await tab.locator('#pair').boundingBox())!;
    await tab.mouse.move(x + 0.4 * width, y + 20);
    await tab.mouse.down();
    await tab.mouse.move(x + 0.75 * width, y + 20, { steps: 3 });
    await tab.mouse.up();
    assert.equal(await tab.inputValue('#split'), '75', 'the line goes where it is dragged');
    assert.deepEqual(clips, ['inset(0px 60% 0px 0px)', 'inset(0px 0px 0px 40%)']);
    assert.deepEqual(faults, []);
  });

  it('measures both, and how far harmonics of degree 0 are from those of degree 2', { timeout: 200_000 }, async () => {
    const { tab, faults } = visit;
    await tab.click('#measure');
    await tab.waitForFunction(
      () => document.querySelector('#status')!.textContent !== 'Measuring…',
      undefined,
      TIMEOUT,
    );
    assert.match(
      (await tab.locator('#status').textContent())!,
      /^\d+ × \d+ pixels, \d+ frames of each in turns, on .+\.$/,
    );
    const rows = await tab.locator('#figures tbody tr').allTextContents();
    const cells = await tab.locator('#figures tbody tr:first-child td').allTextContents();
    const [decibels, worst] = [Number(cells[2]), Number(cells[3])];
    assert.equal(rows.length, 2);
    // A machine that is busy with other tests may get too few frames in the time.
    assert.ok(Number(cells[1]) > 0 || cells[1] === 'too slow to measure', cells[1]);
    assert.ok(decibels > 5 && decibels < 40, `${decibels} dB`);
    assert.ok(worst > 5, `${worst} of 255`);
    // The same settings on both sides give the same image.
    await tab.selectOption('#right-degree', '2');
    await tab.click('#measure');
    await tab.waitForFunction(
      () => document.querySelector('#figures td:nth-child(3)')!.textContent === 'the same',
      undefined,
      TIMEOUT,
    );
    assert.deepEqual(faults, []);
  });

  it('is a page as every other', () => checkPage(visit));
});
