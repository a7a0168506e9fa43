/** The poster of the first page shows what its scene shows first, in the same place, in elements of all shapes. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import type { Page } from 'playwright-core';
import { PNG } from 'pngjs';
import { someOf } from '../support/extent.js';
import { isBuilt, openSite, withScenesToCome, type OpenSite } from './support.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
  readonly revealed: boolean;
}

/** Largest distance between the sides of poster and scene, as a fraction of the scene's size. */
const MAX_APART = 0.02;
const SIZES = [
  [390, 844],
  [768, 1024],
  [1280, 900],
  [1920, 1080],
] as const;

describe('posters', { skip: isBuilt ? false : 'no site: npm run build', timeout: 900_000 }, () => {
  let open: OpenSite;
  before(async () => void (open = await openSite()));
  after(() => open.close());

  for (const [width, height] of someOf(SIZES, 2)) {
    it(`of the first page at ${width} x ${height}`, async () => {
      const posters = await boxesOf('/', width, height, false);
      const scenes = await boxesOf('/', width, height, true);
      const apart = Object.entries(scenes).map(([src, scene]) => distance(posters[src] ?? [0, 0, 0, 0], scene));
      console.log(width, apart.join());
      assert.ok(apart.length > 0, 'no poster');
      assert.ok(Math.max(...apart) <= MAX_APART, apart.join());
    });
  }

  /** Returns the box of pixels of each element of a page, by its source: those of its poster, or of its scene at rest. */
  async function boxesOf(path: string, width: number, height: number, isScene: boolean): Promise<Record<string, Box>> {
    const { tab } = await open.visit(path, {
      ...{ width, height },
      prepare: async (page) => {
        // No scene turns then.
        await page.emulateMedia({ reducedMotion: 'reduce' });
        if (!isScene) await withScenesToCome(page);
      },
    });
    const elements = await tab.locator('gaussian-splat:is([poster], :has([slot=poster]))').all();
    // Nothing else of the page is in the screenshots, and no button and no bar of the element.
    const buttons = 'pause-button, interaction-prompt, views'.split(', ').map((name) => `--${name}-display: none;`);
    const css = `body *:not(gaussian-splat, gaussian-splat *) { visibility: hidden !important }
      gaussian-splat { visibility: visible !important; background: #f0f !important; --progress-bar-height: 0px; ${buttons.join(' ')} }`;
    await tab.addStyleTag({ content: css });
    const boxes: Record<string, Box> = {};
    for (const element of elements) {
      const src = (await element.getAttribute('src'))!;
      if (!/\.(spz|sog)$/.test(src)) continue;
      await element.scrollIntoViewIfNeeded();
      if (isScene) {
        await element.evaluate((splat) => (splat as Splat & { dismissPoster(): void }).dismissPoster());
        await waitFor(tab, () => element.evaluate((splat: Splat) => splat.loaded && splat.revealed));
      } else {
        await waitFor(tab, () => element.evaluate((splat) => splat.matches(':defined')));
      }
      // The poster fades, and its image is decoded.
      await tab.waitForTimeout(2_500);
      boxes[src] = boxOf(await element.screenshot());
    }
    await tab.close();
    return boxes;
  }
});

type Box = readonly [left: number, top: number, right: number, bottom: number];

async function waitFor(tab: Page, condition: () => Promise<boolean>): Promise<void> {
  for (const end = Date.now() + 180_000; !(await condition()); await tab.waitForTimeout(200))
    assert.ok(Date.now() < end, 'no scene');
}

/** Bounds of the pixels that are not of the background, px. Buttons in the corners are left out. */
function boxOf(png: Buffer): Box {
  const { width, height, data } = PNG.sync.read(png);
  const counts = { columns: new Uint32Array(width), rows: new Uint32Array(height) };
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const at = 4 * (y * width + x);
      if (data[at] > 235 && data[at + 1] < 20 && data[at + 2] > 235) continue;
      counts.columns[x]++;
      counts.rows[y]++;
    }
  }
  const bounds = (count: Uint32Array): readonly [number, number] => [
    count.findIndex((value) => value > 3),
    count.findLastIndex((value) => value > 3),
  ];
  const [[left, right], [top, bottom]] = [bounds(counts.columns), bounds(counts.rows)];
  return [left, top, right, bottom];
}

function distance(poster: Box, scene: Box): number {
  const size = Math.max(scene[2] - scene[0], scene[3] - scene[1]);
  return Math.max(...scene.map((side, i) => Math.abs(side - poster[i]))) / size;
}
