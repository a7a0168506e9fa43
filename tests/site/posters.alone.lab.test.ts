/** The posters of the first page and of the gallery are what their scenes show first, streamed ones as soon as they are whole, pixel by pixel, in windows of all shapes. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import type { Page } from 'playwright-core';
import { PNG } from 'pngjs';
import { someOf } from '../support/extent.js';
import { isBuilt, openSite, withScenesToCome, type OpenSite } from './support.js';

interface Splat extends HTMLElement {
  readonly loaded: boolean;
  readonly revealed: boolean;
  readonly stats: { readonly streamed: readonly { coming: number; limit: string | null }[] };
  dismissPoster(): void;
}

/** Largest mean difference of poster and first frame, of 255. The rounding of WebP takes 1 to 2. */
const MAX_DIFFERENCE = 3;
/** The same of scenes whose bricks and grass are finer than the pixels of a poster of 720 x 480. */
const MAX_OF_FINE: Readonly<Record<string, number>> = { '/gallery/house/': 5 };
/** Windows that give the scene of the first page different shapes. */
const SIZES = [
  [1280, 800],
  [390, 844],
  [768, 1024],
  [844, 390],
  [2560, 1440],
] as const;
const GALLERY = ['robot', 'apartment', 'statue', 'skull', 'house', 'hall', 'toy', 'vase'];

describe('posters', { skip: isBuilt ? false : 'no site: npm run build', timeout: 1_800_000 }, () => {
  let open: OpenSite;
  before(async () => void (open = await openSite()));
  after(() => open.close());

  for (const [width, height] of someOf(SIZES, 2))
    it(`the first page at ${width} x ${height}`, () => assertSame('/', width, height));
  for (const name of someOf(GALLERY, 1)) it(`${name} in the gallery`, () => assertSame(`/gallery/${name}/`, 700, 640));

  async function assertSame(path: string, width: number, height: number): Promise<void> {
    const poster = await imageOf(path, width, height, false);
    const frame = await imageOf(path, width, height, true);
    const [off, mirrored] = [differenceOf(poster, frame), differenceOf(poster, mirrorOf(frame))];
    console.log(`${path} at ${width} x ${height}: ${off.toFixed(2)} of 255, ${mirrored.toFixed(1)} if mirrored`);
    assert.ok(off <= (MAX_OF_FINE[path] ?? MAX_DIFFERENCE), `${path}: ${off} of 255`);
    assert.ok(mirrored > MAX_DIFFERENCE, `${path}: an image that differs from its mirror image`);
  }

  /** Returns the first element of a page as it is shown: its poster, or its scene at rest. */
  async function imageOf(path: string, width: number, height: number, isScene: boolean): Promise<PNG> {
    const prepare = async (page: Page): Promise<void> => {
      // Nothing turns or plays then, and walkers stay at the view of the page.
      await page.emulateMedia({ reducedMotion: 'reduce' });
      await page.route('**/*.floor', () => undefined);
      if (!isScene) await withScenesToCome(page);
    };
    const { tab } = await open.visit(path, { width, height, prepare });
    // Nothing else of the page is in the screenshots, and no button and no bar of the element.
    const buttons = 'pause-button, interaction-prompt, views'.split(', ').map((name) => `--${name}-display: none;`);
    await tab.addStyleTag({
      content: `body *:not(gaussian-splat, gaussian-splat *) { visibility: hidden !important }
      gaussian-splat { visibility: visible !important; background: #888 !important; --progress-bar-height: 0px; ${buttons.join(' ')} }
      gaussian-splat::part(measure-button), gaussian-splat::part(vr-button), gaussian-splat::part(credits), [slot^='hotspot'] { visibility: hidden !important }`,
    });
    const element = tab.locator('gaussian-splat').first();
    const isShown = isScene
      ? () => element.evaluate(isWhole)
      : () => element.evaluate((splat) => splat.matches(':defined'));
    if (isScene) await element.evaluate((splat: Splat) => splat.dismissPoster?.());
    for (let tries = 0; !(await isShown()); tries++) {
      assert.ok(tries < 1_200, 'no scene');
      await tab.waitForTimeout(200);
    }
    // The poster fades, and its image is decoded.
    await tab.waitForTimeout(2_500);
    const image = PNG.sync.read(await element.screenshot({ timeout: 120_000 }));
    await tab.close();
    return image;
  }
});

/** Whether an element shows all of its scene: no page of a streamed one is on its way. */
const isWhole = ({ loaded, revealed, stats }: Splat): boolean =>
  loaded && revealed && stats.streamed.every(({ coming, limit }) => coming === 0 && limit !== 'transit');

/** Mean absolute difference of two images of one size, of 255. */
function differenceOf(a: PNG, b: PNG): number {
  assert.deepEqual([a.width, a.height], [b.width, b.height]);
  let sum = 0;
  for (let i = 0; i < a.data.length; i++) if (i % 4 < 3) sum += Math.abs(a.data[i] - b.data[i]);
  return sum / (3 * a.width * a.height);
}

function mirrorOf({ width, height, data }: PNG): PNG {
  const mirror = new PNG({ width, height });
  for (let i = 0; i < width * height; i++) {
    const from = 4 * (i - (i % width) + width - 1 - (i % width));
    mirror.data.set(data.subarray(from, from + 4), 4 * i);
  }
  return mirror;
}
