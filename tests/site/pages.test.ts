/** Every page of the built site (of the documents one, unless SITE=full) in Chromium: nothing fails, nothing is missing, nothing is wider than a phone, axe finds nothing. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import type { Page } from 'playwright-core';
import { isBuilt, openSite, pagesOf, root, withCompass, type OpenSite, type Visit } from './support.js';

const AXE = `${root}node_modules/axe-core/axe.min.js`;
/** Pages that measure as soon as they are open are given next to nothing to measure. */
const QUERIES: Readonly<Record<string, string>> = {
  '/bench/frontier.html': '?only=^default$&n=1000&w=64&h=48&frames=1&warmup=0&views=1',
  '/bench/stability.html': '?only=S7&peers=0',
  '/bench/generators.html': '?models=/fixtures/compass.ply',
};
interface AxeResults {
  readonly violations: readonly { id: string; help: string; nodes: readonly { html: string }[] }[];
  readonly passes: readonly unknown[];
}

/** Colours are looked at where they can differ; over a long document that takes axe longer than all the rest. */
async function violations(tab: Page, colors = true): Promise<string[]> {
  const options = { rules: { 'color-contrast': { enabled: colors } } };
  const found = (await tab.evaluate(`axe.run(document, ${JSON.stringify(options)})`)) as AxeResults;
  assert.ok(found.passes.length > 5, 'axe has looked at something');
  return found.violations.map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ html }) => html).join(' | ')}`);
}

/** The document whose colours stand for those of all. */
const LONGEST = '/docs/packages/element/';
/** Documents have no scripts and one layout: `npm run test:site` opens all of them, `npm test` one that has everything. */
const isVisited = (url: string): boolean => process.env.SITE === 'full' || !isDocument(url) || url === LONGEST;
const isDocument = (url: string): boolean => /^\/docs\/./.test(url);

const widerThanItsWindow = (tab: Page): Promise<number> =>
  tab.evaluate(() => document.documentElement.scrollWidth - innerWidth);

describe('every page of the site', { skip: isBuilt ? false : 'no site: npm run build' }, () => {
  let open: OpenSite;
  let only: Visit;
  before(async () => {
    open = await openSite();
    only = await open.visit('/', { prepare: withCompass });
  });
  after(() => open.close());

  for (const url of isBuilt ? pagesOf().filter(isVisited) : []) {
    it(url, { timeout: 120_000 }, async () => {
      const { tab, faults } = only;
      await tab.setViewportSize({ width: 390, height: 400 });
      await tab.emulateMedia({ colorScheme: 'light' });
      await open.go(only, url + (QUERIES[url] ?? ''));
      assert.equal(await tab.locator('h1').count(), 1, 'one heading of the first rank');
      assert.notEqual(await tab.title(), '');
      await tab.addScriptTag({ path: AXE });
      for (const [width, colorScheme] of [
        [390, 'light'],
        [1280, 'dark'],
      ] as const) {
        // Documents share layout, markup and colours: once over each is enough, and a third of the time.
        if (width === 1280 && isDocument(url)) continue;
        await tab.setViewportSize({ width, height: 400 });
        await tab.emulateMedia({ colorScheme });
        assert.ok((await widerThanItsWindow(tab)) <= 0, `wider than ${width} pixels`);
        const colors = !isDocument(url) || url === LONGEST;
        assert.deepEqual(await violations(tab, colors), [], `${width} pixels, ${colorScheme}`);
      }
      assert.deepEqual(faults, []);
    });
  }

  it('and axe would find something', async () => {
    const { tab } = only;
    await open.go(only, '/docs/');
    await tab.addScriptTag({ path: AXE });
    await tab.evaluate(() => document.querySelector('main')!.append(document.createElement('input')));
    assert.ok((await violations(tab)).some((text) => text.startsWith('label')));
  });
});
