/** The built site on a server, and Chromium to visit it: everything that goes wrong on a page is written down. */
import { chromium, type Browser, type Page } from 'playwright-core';
import { existsSync, readFileSync } from 'node:fs';
import { type Server } from 'node:http';
import { fileURLToPath } from 'node:url';

export const root = fileURLToPath(new URL('../../', import.meta.url));
export const site = `${root}demo/dist/`;
const scripts = (path: string): Promise<Record<string, never>> =>
  import(new URL(`../../scripts/lib/${path}`, import.meta.url).href);

/** Addresses of all pages, as the build has listed them. */
export function pagesOf(): string[] {
  return JSON.parse(readFileSync(`${site}pages.json`, 'utf8')) as string[];
}

/** Missing if the site has not been built: `npm run build`. */
export const isBuilt = existsSync(`${site}pages.json`);

const compass = readFileSync(`${root}tests/element/browser/fixtures/compass.ply`);

export interface Visit {
  readonly tab: Page;
  /** Errors on the console, uncaught ones, and answers that no page should get. */
  readonly faults: string[];
}

export interface VisitOptions {
  /** Size of the window in CSS pixels. */
  readonly width?: number;
  readonly height?: number;
  /** Called before the page is requested. */
  readonly prepare?: (tab: Page) => Promise<unknown>;
}

export interface OpenSite {
  /** Opens a page. */
  visit(path: string, options?: VisitOptions): Promise<Visit>;
  /** Goes to another page in the same tab, which is cheaper, and forgets the faults of the last. */
  go(visit: Visit, path: string): Promise<void>;
  close(): Promise<void>;
}

/** A model may have its contract beside it; that it has not is an answer, too. */
const MAY_BE_MISSING = /\.contract\.json$/;
/** Code of the errors that elements print on the page `/without-webgpu/`, which shows them without WebGPU. */
const WITHOUT_WEBGPU = '[unsupported/no-webgpu]';

/** A scene of a few splats in place of the first page's and of the skull, for tests that are about something else. */
export const withCompass = (tab: Page): Promise<unknown> =>
  tab.route(/\/(skull|apartment)\.spz$/, (route) =>
    route.fulfill({ body: compass, contentType: 'application/octet-stream' }),
  );

/** Scenes and models that never arrive, until the function that this returns is called: the page is as it is while they load. */
export async function withScenesToCome(tab: Page): Promise<() => Promise<void>> {
  const scenes = /\.(spz|sog|onnx|gsv)$|lod-meta\.json$/;
  await tab.route(scenes, () => undefined);
  return () => tab.unroute(scenes);
}

/** Serves the site and the scenes of the element's tests (`/fixtures/`), and starts the browser. */
export async function openSite(): Promise<OpenSite> {
  const { serve } = await scripts('../../packages/cli/src/lib/server.mjs');
  const { findChromium, SWIFTSHADER_FLAGS } = await scripts('chromium.mjs');
  const server = await (serve as (mounts: object) => Promise<Server>)({
    '/': site,
    '/fixtures/': `${root}tests/element/browser/fixtures/`,
  });
  const { port } = server.address() as { port: number };
  const browser: Browser = await chromium.launch({
    executablePath: (findChromium as () => string)(),
    args: SWIFTSHADER_FLAGS,
  });
  return {
    async visit(path, { width = 390, height = 800, prepare } = {}) {
      const tab = await browser.newPage({ viewport: { width, height } });
      const faults: string[] = [];
      tab.on('pageerror', (error) => faults.push(`uncaught: ${error.message}`));
      tab.on('console', (message) => {
        const { url } = message.location();
        const text = message.text();
        const isShown = tab.url().endsWith('/without-webgpu/') && text.includes(WITHOUT_WEBGPU);
        if (message.type() === 'error' && !isShown && !MAY_BE_MISSING.test(url)) faults.push(`console: ${text} ${url}`);
      });
      tab.on('response', (response) => {
        const { pathname } = new URL(response.url());
        if (response.status() >= 400 && !MAY_BE_MISSING.test(pathname))
          faults.push(`${response.status()}: ${pathname}`);
      });
      await prepare?.(tab);
      await tab.goto(`http://localhost:${port}${path}`);
      return { tab, faults };
    },
    async go({ tab, faults }, path) {
      faults.length = 0;
      await tab.goto(`http://localhost:${port}${path}`);
    },
    async close() {
      await browser.close();
      server.closeAllConnections();
      server.close();
    },
  };
}
