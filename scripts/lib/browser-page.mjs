/** Opens one page of the built demo in headless Chromium and waits for the report that it leaves in `window.report`. */
import { basename, dirname, resolve, sep } from 'node:path';
import { chromium } from 'playwright-core';
import { findChromium, gpuFlags } from './chromium.mjs';
import { root } from './run.mjs';
import { serve } from '../../packages/cli/src/lib/server.mjs';

/** Exact timestamps: browsers round them to 100 µs by default. */
const MEASURING_FLAGS = ['--disable-dawn-features=timestamp_quantization'];
/**
 * @param page path in demo/dist, for example `bench/index.html`.
 * @param query {Record<string, string>} of its address.
 * @param scene {string | undefined} a scene file on disk that takes the place of the one that ships.
 * @param mounts {Record<string, string> | undefined} further folders by the prefix of their addresses.
 * @returns the report; throws the error that the page reports, or after `minutes`.
 */
export async function runPage(page, query, { scene, mounts: others, minutes = 30, onProgress = () => {} } = {}) {
  const mounts = { '/': `${root}demo/dist`, ...others };
  if (scene) mounts['/local/'] = dirname(resolve(scene)) + sep;
  const server = await serve(mounts);
  const browser = await chromium.launch({ executablePath: findChromium(), args: [...gpuFlags(), ...MEASURING_FLAGS] });
  try {
    const address = new URL(page, `http://localhost:${server.address().port}/`);
    for (const [key, value] of Object.entries(query)) if (value !== undefined) address.searchParams.set(key, value);
    if (scene) address.searchParams.set('scene', `/local/${encodeURIComponent(basename(scene))}`);
    return await reportOf(await browser.newPage(), address, minutes, onProgress);
  } finally {
    await browser.close();
    server.closeAllConnections();
    server.close();
  }
}

async function reportOf(tab, address, minutes, onProgress) {
  const complaints = [];
  tab.on('pageerror', (error) => complaints.push(error.message));
  tab.on('console', (message) => message.type() === 'error' && complaints.push(message.text()));
  await tab.exposeFunction('onBenchProgress', onProgress);
  await tab.goto(address.href);
  try {
    await tab.waitForFunction(() => window.report !== undefined, undefined, {
      timeout: 60_000 * minutes,
      polling: 500,
    });
  } catch (error) {
    throw new Error(`${address}: no report. ${[...complaints, error.message].join('\n')}`, { cause: error });
  }
  const report = await tab.evaluate(() => window.report);
  if (report.error) throw new Error([report.error, ...complaints].join('\n'));
  return report;
}
