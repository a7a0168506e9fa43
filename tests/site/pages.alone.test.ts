/** Pages of the built site (one of each layout, unless SITE=full) in Chromium: nothing fails, nothing is missing, nothing is wider than a phone, axe finds nothing. */
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import { addAxe, checkPage, violations } from './page-check.js';
import { isBuilt, openSite, pagesOf, withCompass, withScenesToCome, type OpenSite, type Visit } from './support.js';

const isFull = process.env.SITE === 'full';
/** Pages that `npm test` opens, one of each layout; the laboratory opens all. */
const DAILY = ['/check/', '/docs/', '/examples/', '/speed/', '/reference/'];

/** Pages that measure as soon as they are open are given next to nothing to measure. */
const QUERIES: Readonly<Record<string, string>> = {
  '/bench/frontier.html': '?only=^default$&n=1000&w=64&h=48&frames=1&warmup=0&views=1',
  '/bench/stability.html': '?only=S7&peers=0',
  '/bench/generators.html': '?models=/fixtures/compass.ply',
};
/** Pages whose scenes other tests load: here their requests stay pending, which saves CPU time. */
const WITHOUT_SCENES = ['/examples/', '/react/', '/vue/'];

/** The document whose colors stand for those of all. */
const LONGEST = '/docs/guide/troubleshooting/';
const isDocument = (url: string): boolean => /^\/docs\/./.test(url);
/** Documents have no scripts and one layout: `npm run test:site` and the laboratory open all of them, `npm test` one that has everything. */
const isVisited = (url: string): boolean => isFull || url === LONGEST || DAILY.includes(url);

describe('every page of the site', { skip: isBuilt ? false : 'no site: npm run build' }, () => {
  let open: OpenSite;
  let only: Visit;
  before(async () => {
    open = await openSite();
    only = await open.visit('/docs/', { prepare: withCompass });
  });
  after(() => open.close());

  for (const url of isBuilt ? pagesOf().filter(isVisited) : []) {
    it(url, { timeout: 120_000 }, async () => {
      const { tab } = only;
      await tab.setViewportSize({ width: 390, height: 400 });
      await tab.emulateMedia({ colorScheme: 'light' });
      const release = !isFull && WITHOUT_SCENES.includes(url) ? await withScenesToCome(tab) : undefined;
      await open.go(only, url + (QUERIES[url] ?? ''));
      // Documents share layout, markup and colors: once over each is enough, and a third of the time.
      // Pages that measure on opening have the form and the table of their index.
      const bothScreens = !isDocument(url) && (isFull || QUERIES[url] === undefined);
      await checkPage(only, { colors: !isDocument(url) || url === LONGEST, bothScreens });
      await release?.();
    });
  }

  it('and axe would find something', async () => {
    const { tab } = only;
    await open.go(only, '/docs/');
    await addAxe(tab);
    await tab.evaluate(() => document.querySelector('main')!.append(document.createElement('input')));
    assert.ok((await violations(tab)).some((text) => text.startsWith('label')));
  });
});
