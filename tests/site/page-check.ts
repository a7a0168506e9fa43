/** Requirements of every page: one heading, a title, nothing wider than its window, nothing that axe finds, no fault. */
import assert from 'node:assert/strict';
import type { Page } from 'playwright-core';
import { root, type Visit } from './support.js';

const AXE = `${root}node_modules/axe-core/axe.min.js`;
const isFull = process.env.SITE === 'full';

interface AxeResults {
  readonly violations: readonly { id: string; help: string; nodes: readonly { html: string }[] }[];
  readonly passes: readonly unknown[];
}

/** Rows of long tables and lists are alike: some stand for all, unless SITE=full. */
const ALIKE = ['tbody tr:nth-child(n + 5)', 'details.row:nth-of-type(n + 4)', 'details .field:nth-of-type(n + 4)'];

interface Screen {
  readonly width: number;
  readonly colorScheme: 'light' | 'dark';
  readonly forcedColors?: 'active';
}
/** Light on a phone, dark on a desk; with SITE=full also a desk zoomed to 200 % whose system forces its colors. */
const SCREENS: readonly Screen[] = [
  { width: 390, colorScheme: 'light' },
  { width: 1280, colorScheme: 'dark' },
  ...(isFull ? [{ width: 640, colorScheme: 'light', forcedColors: 'active' } as const] : []),
];

export interface PageCheckOptions {
  /** Looks at the colors, which over a long document takes axe longer than all the rest. */
  readonly colors?: boolean;
  /** Looks at the second screen, too: documents share layout, markup and colors. */
  readonly bothScreens?: boolean;
}

/** Checks the page that a tab shows; its window is afterwards as wide as the last screen. */
export async function checkPage(
  { tab, faults }: Visit,
  { colors = true, bothScreens = true }: PageCheckOptions = {},
): Promise<void> {
  assert.equal(await tab.locator('h1').count(), 1, 'one heading of the first rank');
  assert.notEqual(await tab.title(), '');
  // Width of a page of 1280 pixels at a zoom of 400 %.
  await tab.setViewportSize({ width: NARROWEST, height: 400 });
  assert.ok((await overflowOf(tab)) <= 0, `wider than ${NARROWEST} pixels`);
  await addAxe(tab);
  for (const { width, colorScheme, forcedColors } of bothScreens ? SCREENS : SCREENS.slice(0, 1)) {
    await tab.setViewportSize({ width, height: 400 });
    await tab.emulateMedia({ colorScheme, forcedColors: forcedColors ?? 'none' });
    assert.ok((await overflowOf(tab)) <= 0, `wider than ${width} pixels`);
    assert.deepEqual(await violations(tab, colors), [], `${width} pixels, ${colorScheme}`);
  }
  await tab.emulateMedia({ forcedColors: 'none' });
  assert.deepEqual(faults, []);
}

const NARROWEST = 320;
const overflowOf = (tab: Page): Promise<number> =>
  tab.evaluate(() => document.documentElement.scrollWidth - innerWidth);

export async function addAxe(tab: Page): Promise<void> {
  await tab.addScriptTag({ path: AXE });
}

/** Violations that axe finds on a page. */
export async function violations(tab: Page, colors = true): Promise<string[]> {
  const context = { include: [['html']], exclude: isFull ? [] : ALIKE.map((selector) => [selector]) };
  const options = { rules: { 'color-contrast': { enabled: colors } } };
  const found = (await tab.evaluate(`axe.run(${JSON.stringify(context)}, ${JSON.stringify(options)})`)) as AxeResults;
  assert.ok(found.passes.length > 5, 'axe has checked something');
  return found.violations.map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ html }) => html).join(' | ')}`);
}
