/** Every page of the built site in Chromium: nothing fails, nothing is missing, nothing is wider than a phone, axe finds nothing. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import type { Page } from 'playwright-core';
import { isBuilt, openSite, pagesOf, root, type OpenSite } from './support.js';

const AXE = `${root}node_modules/axe-core/axe.min.js`;
/** Pages that measure as soon as they are open are given next to nothing to measure. */
const QUERIES: Readonly<Record<string, string>> = {
  '/bench/frontier.html': '?only=^default$&n=1000&w=64&h=48&frames=1&warmup=0&views=1',
  '/bench/stability.html': '?only=S7&peers=0',
  '/bench/generators.html': '?models=/fixtures/compass.ply',
};
/** Scenes that are waited for; the others are shown by tests of their own. */
const WAITED_FOR: Readonly<Record<string, string>> = { '/': '#hero' };

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
const isDocument = (url: string): boolean => /^\/docs\/./.test(url);

const widerThanItsWindow = (tab: Page): Promise<number> =>
  tab.evaluate(() => document.documentElement.scrollWidth - innerWidth);

describe('every page of the site', { skip: isBuilt ? false : 'no site: npm run build' }, () => {
  let open: OpenSite;
  before(async () => (open = await openSite()));
  after(() => open.close());

  for (const url of isBuilt ? pagesOf() : []) {
    it(url, { timeout: 120_000 }, async () => {
      const { tab, faults } = await open.visit(url + (QUERIES[url] ?? ''));
      const scene = WAITED_FOR[url];
      if (scene) await tab.waitForFunction((id) => document.querySelector<Scene>(id)?.loaded, scene, PATIENCE);
      assert.equal(await tab.locator('h1').count(), 1, 'one heading of the first rank');
      assert.notEqual(await tab.title(), '');
      await tab.addScriptTag({ path: AXE });
      for (const [width, colorScheme] of [
        [390, 'light'],
        [1280, 'dark'],
      ] as const) {
        await tab.setViewportSize({ width, height: 800 });
        await tab.emulateMedia({ colorScheme });
        assert.ok((await widerThanItsWindow(tab)) <= 0, `wider than ${width} pixels`);
        // Documents share layout, markup and colours: once over each is enough, and a third of the time.
        if (width === 1280 && isDocument(url)) continue;
        const colors = !isDocument(url) || url === LONGEST;
        assert.deepEqual(await violations(tab, colors), [], `${width} pixels, ${colorScheme}`);
      }
      assert.deepEqual(faults, []);
      await tab.close();
    });
  }

  it('and axe would find something', async () => {
    const { tab } = await open.visit('/docs/');
    await tab.addScriptTag({ path: AXE });
    await tab.evaluate(() => document.querySelector('main')!.append(document.createElement('input')));
    assert.ok((await violations(tab)).some((text) => text.startsWith('label')));
    await tab.close();
  });
});

interface Scene extends Element {
  readonly loaded: boolean;
}
const PATIENCE = { timeout: 100_000, polling: 200 };
