/** The recipes of the README and of the first page, done as a reader does them: saved, opened from the disk and from another server. The screen is read, not the element. */
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import { once } from 'node:events';
import { copyFileSync, cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import type { Server } from 'node:http';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { pathToFileURL } from 'node:url';
import { chromium, type Browser } from 'playwright-core';
import { PNG } from 'pngjs';
import { snippets } from './snippets.js';
import { isLab, onlyInLab } from '../support/extent.js';
import { isBuilt, root } from './support.js';

const load = (path: string): Promise<Record<string, never>> => import(new URL(`../../${path}`, import.meta.url).href);
const fixture = (name: string): string => join(root, 'tests/element/browser/fixtures', name);
const SECONDS = 120;

describe('recipes', { skip: isBuilt ? false : 'no site: npm run build', timeout: 900_000 }, () => {
  const folder = mkdtempSync(join(tmpdir(), 'recipes-'));
  const servers: Server[] = [];
  let browser: Browser;
  before(async () => {
    const { findChromium, SWIFTSHADER_FLAGS } = await load('scripts/lib/chromium.mjs');
    browser = await chromium.launch({ executablePath: (findChromium as () => string)(), args: SWIFTSHADER_FLAGS });
  });
  after(async () => {
    await browser.close();
    for (const server of servers) {
      server.closeAllConnections();
      server.close();
    }
    rmSync(folder, { recursive: true });
  });

  async function serveFolder(path: string): Promise<string> {
    const { serve } = await load('packages/cli/src/lib/server.mjs');
    const server = await (serve as (mounts: object) => Promise<Server>)({ '/': path });
    servers.push(server);
    return `http://127.0.0.1:${(server.address() as { port: number }).port}/`;
  }

  /** Waits until the page has a scene on the screen: many pixels of its element are not of the commonest color. */
  async function assertShown(address: string): Promise<void> {
    const tab = await browser.newPage({ viewport: { width: 400, height: 300 } });
    const said: string[] = [];
    tab.on('console', (message) => said.push(message.text()));
    await tab.goto(address);
    const end = Date.now() + SECONDS * 1000;
    let share = 0;
    while (share < 0.02 && Date.now() < end) {
      await tab.waitForTimeout(500);
      share = shareOfPaint(await tab.locator('gaussian-splat').first().screenshot());
    }
    assert.ok(share >= 0.02, `${address}: ${share} of the screen is painted\n${said.join('\n')}`);
    await tab.close();
  }

  /** The command of the repository, as the README has it. */
  function makePage(...args: string[]): string {
    const target = join(folder, args.at(-1)!);
    const words = [...args.slice(0, -1), target, ...(args.includes('--single') ? [] : ['--no-serve'])];
    const bin = join(root, 'packages/cli/bin/gaussian-splat.mjs');
    const { status, stdout, stderr } = spawnSync(process.execPath, [bin, 'page', ...words], { encoding: 'utf8' });
    assert.equal(status, 0, stdout + stderr);
    return target;
  }

  it(
    'the whole HTML file of the first page shows its scene from the disk, and from another server',
    { skip: onlyInLab },
    async () => {
      const start = spawn(process.execPath, ['scripts/start.mjs'], { cwd: root, env: { ...process.env, PORT: '0' } });
      try {
        let output = '';
        start.stdout.on('data', (data) => (output += String(data)));
        while (!/http:\S+/.test(output)) await once(start.stdout, 'data');
        const tab = await browser.newPage();
        await tab.goto(/http:\S+/.exec(output)![0]);
        await tab.click('#copy-page');
        await tab.waitForFunction(() => document.querySelector('#snippet')!.textContent!.includes('<!doctype'));
        const html = await tab.locator('#snippet').textContent();
        await tab.close();
        mkdirSync(join(folder, 'copied'));
        writeFileSync(join(folder, 'copied/index.html'), html!);
        await assertShown(pathToFileURL(join(folder, 'copied/index.html')).href);
        await assertShown(await serveFolder(join(folder, 'copied')));
      } finally {
        start.kill();
      }
    },
  );

  it('the first block of the README, and the page of Get started, show a scene beside the unpacked release', async () => {
    const { unzipSync } = await import('fflate');
    const { zipOfCdn } = await load('scripts/lib/release.mjs');
    const files = unzipSync((zipOfCdn as (options: object) => Uint8Array)({ withRuntime: false }));
    const blocks = snippets('html').filter(({ code }) => code.startsWith('<!doctype'));
    assert.ok(blocks.length >= 2, `${blocks.length} whole pages`);
    for (const [i, { code }] of blocks.entries()) {
      const place = join(folder, `block-${i}`);
      for (const [name, bytes] of Object.entries(files)) {
        const path = join(place, name);
        mkdirSync(join(path, '..'), { recursive: true });
        writeFileSync(path, bytes);
      }
      // Readers who have built it have the same folder by this name.
      cpSync(join(place, 'gaussian-splat'), join(place, 'cdn'), { recursive: true });
      for (const [, name] of code.matchAll(/src="([\w-]+\.spz)"/g))
        copyFileSync(fixture('compass.ply'), join(place, name));
      writeFileSync(join(place, 'index.html'), code);
      await assertShown(await serveFolder(place));
    }
  });

  it('the folder of `page` shows scenes and meshes from a server, and says from a disk what it needs', async () => {
    const place = makePage(fixture('compass.ply'), 'folder');
    await assertShown(await serveFolder(place));
    if (isLab) await assertShown(await serveFolder(makePage(fixture('textured.glb'), 'mesh')));
    const tab = await browser.newPage();
    await tab.goto(pathToFileURL(join(place, 'index.html')).href);
    assert.match(await tab.locator('gaussian-splat').innerText(), /needs a web server.*http-server/);
    await tab.close();
  });

  it('the one file of `page --single` shows a scene, or a mesh, from the disk', { skip: onlyInLab }, async () => {
    for (const [i, name] of ['compass.ply', 'textured.glb'].entries()) {
      const place = makePage(fixture(name), '--single', `single-${i}`);
      await assertShown(pathToFileURL(join(place, 'index.html')).href);
      assert.doesNotMatch(readFileSync(join(place, 'index.html'), 'utf8'), /web server/);
    }
  });
});

/** The fraction of pixels that are not of the commonest color. */
function shareOfPaint(png: Buffer): number {
  const { data } = PNG.sync.read(png);
  const counts = new Map<number, number>();
  for (let i = 0; i < data.length; i += 4) {
    const color = data.readUInt32LE(i);
    counts.set(color, (counts.get(color) ?? 0) + 1);
  }
  return 1 - Math.max(...counts.values()) / (data.length / 4);
}
