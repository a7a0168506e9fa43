/** Snippets of documents work: TypeScript has the right types, commands exist, and HTML draws a scene. */
import assert from 'node:assert/strict';
import { spawnSync, type SpawnSyncReturns } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import type { Page } from 'playwright-core';
import { build } from 'esbuild';
import { PNG } from 'pngjs';
import { compileTemplate, parse } from 'vue/compiler-sfc';
import { encodeFloorMap } from '@gaussian-splat/formats/floor';
import { clipOf } from '../support/clips.js';
import { fountain } from '../support/scenes/fountain.js';
import { isBuilt, openSite, root } from './support.js';
import { snippets, type Snippet } from './snippets.js';

const skip = isBuilt ? false : 'no site: npm run build';
const isFull = process.env.SITE === 'full';

/** Names available to the reader of a snippet: those of the text around it, or imports of the snippet before. */
const AT_HAND = `
import type * as React from 'react';
import type * as core from '@gaussian-splat/core';
import type { Contract, gaussianLayout as layoutOf } from '@gaussian-splat/core/contract';
import type { OnnxHeader } from '@gaussian-splat/core/onnx';
import type * as optimize from '@gaussian-splat/optimize';
import type * as models from '@gaussian-splat/generator';
import type * as drawing from '@gaussian-splat/renderer';
import type { GaussianSplatElement } from '@gaussian-splat/react';
declare global {
  const adapter: GPUAdapter;
  const device: GPUDevice;
  const texture: GPUTexture;
  const canvasTexture: GPUTexture;
  const tensor: GPUBuffer;
  const rows: number;
  const width: number;
  const height: number;
  const imageBitmap: ImageBitmap;
  const bytes: Uint8Array<ArrayBuffer>;
  const ref: React.RefObject<GaussianSplatElement | null>;
  const [camera, cameraOfHouse, cameraOfGarden]: core.Camera[];
  const [cloud, house, garden]: core.GaussianCloud[];
  const { positions, scales, rotations, opacities, sh }: core.GaussianCloud;
  const element: GaussianSplatElement & { updateSplats(first: number, arrays: object): Promise<void> };
  const response: Response & { readonly body: ReadableStream<Uint8Array<ArrayBuffer>> };
  const bounds: ReturnType<typeof core.boundsOf>;
  const header: OnnxHeader;
  const contract: Contract;
  const boundsOf: typeof core.boundsOf;
  const gaussianLayout: typeof layoutOf;
  const views: optimize.ViewSplit;
  const defineNuxtConfig: (config: {
    hooks: Record<string, (manifest: Record<string, { dynamicImports?: string[] }>) => void>;
  }) => void;
  const gaussians: drawing.GaussianBuffers;
  const roomGaussians: drawing.GaussianBuffers;
  const plantGaussians: drawing.GaussianBuffers;
  const matrix: core.Matrix4;
  const moved: core.Matrix4;
  const depthTexture: GPUTexture;
  const encoder: GPUCommandEncoder;
  const { DynamicGaussians }: typeof drawing;
  const generator: models.Generator;
  const viewpoint: drawing.Viewpoint;
  const gl: WebGL2RenderingContext;
  const framebuffer: WebGLFramebuffer | null;
  const view: core.Matrix4;
  const projection: core.Matrix4;
  function requestFrame(): void;
}
`;

/** The page that `gaussian-splat page` makes of a scene whose name must be escaped in addresses and in HTML. */
function makePage(folder: string): SpawnSyncReturns<string> {
  const scene = join(folder, '../mine & yours.ply');
  copyFileSync(join(root, 'tests/element/browser/fixtures/compass.ply'), scene);
  return spawnSync(process.execPath, ['packages/cli/bin/gaussian-splat.mjs', 'page', scene, folder, '--no-serve'], {
    cwd: root,
    encoding: 'utf8',
  });
}

describe('code that documents recommend', { skip }, () => {
  const made = { folder: '', index: '' };
  before(() => {
    made.folder = join(mkdtempSync(join(tmpdir(), 'page-')), 'my page');
    const { stderr, status } = makePage(made.folder);
    assert.equal(status, 0, stderr);
    made.index = readFileSync(join(made.folder, 'index.html'), 'utf8');
  });
  after(() => rmSync(join(made.folder, '..'), { recursive: true }));

  it('TypeScript has the types that it needs', () => {
    const folder = join(root, '.cache/snippets');
    rmSync(folder, { recursive: true, force: true });
    mkdirSync(folder, { recursive: true });
    writeFileSync(join(folder, 'at-hand.ts'), AT_HAND);
    // A line for the browser's console has no types.
    const typed = snippets('ts', 'tsx', 'js').filter(
      // three.js has no types of its own; what draws in its scenes is opened by tests/three.
      ({ language, code }) => language !== 'js' || (code.includes('import ') && !code.includes('three/webgpu')),
    );
    const files = typed.map(({ language, code, place }, i) => {
      const path = join(folder, `${i}.${language === 'js' ? 'ts' : language}`);
      // Every snippet is a module, so that its names are local.
      writeFileSync(path, `// ${place}\n${code}\nexport {};\n`);
      return path;
    });
    assert.ok(files.length > 10, `${files.length} snippets`);
    const compilerOptions = {
      ...{ target: 'es2022', module: 'esnext', moduleResolution: 'bundler', jsx: 'react-jsx' },
      ...{ lib: ['es2023', 'dom', 'dom.iterable'], types: ['@webgpu/types', 'react'] },
      ...{ strict: true, noEmit: true, skipLibCheck: true },
    };
    writeFileSync(join(folder, 'tsconfig.json'), JSON.stringify({ compilerOptions, files: ['at-hand.ts', ...files] }));
    const compiler = join(root, 'node_modules/typescript-7/bin/tsc');
    const { status, stdout } = spawnSync(process.execPath, [compiler, '--project', folder, '--pretty', 'false'], {
      cwd: folder,
      encoding: 'utf8',
    });
    const lines = stdout.split('\n').filter(Boolean);
    const found = lines.map((line) => line.replace(/^(\d+)\.tsx?/, (_, i) => typed[Number(i)].place));
    assert.deepEqual(found, []);
    assert.equal(status, 0);
  });

  it('Vue compiles its components, and its checker finds the types that they need', () => {
    const folder = join(root, '.cache/snippets-vue');
    rmSync(folder, { recursive: true, force: true });
    mkdirSync(folder, { recursive: true });
    const all = snippets('vue');
    assert.ok(all.length >= 2, `${all.length} snippets`);
    for (const [i, { code, place }] of all.entries()) {
      const { descriptor, errors } = parse(code);
      assert.deepEqual(errors, [], place);
      const { errors: inTemplate } = compileTemplate({
        ...{ source: descriptor.template!.content, filename: 'App.vue', id: 'app' },
        compilerOptions: {
          isCustomElement: (tag) => tag === 'gaussian-splat',
          expressionPlugins: ['typescript'],
        },
      });
      assert.deepEqual(inTemplate, [], place);
      // Snippets of JavaScript have no types to check.
      if (descriptor.scriptSetup?.lang === 'ts') writeFileSync(join(folder, `${i}.vue`), code);
    }
    const config = { extends: '../../demo/vue/tsconfig.json', include: ['*.vue', '../../demo/vue/env.d.ts'] };
    writeFileSync(join(folder, 'tsconfig.json'), JSON.stringify(config));
    const checker = join(root, 'node_modules/vue-tsc/bin/vue-tsc.js');
    const { status, stdout } = spawnSync(process.execPath, [checker, '--noEmit', '--project', folder], {
      encoding: 'utf8',
    });
    assert.equal(status, 0, stdout);
  });

  it('commands are scripts of this repository', () => {
    const { scripts } = JSON.parse(readFileSync(join(root, 'package.json'), 'utf8')) as { scripts: object };
    const shell = snippets('sh').map(({ code }) => code);
    const asked = shell.flatMap((code) => [...code.matchAll(/npm run ([\w:-]+)(?! .*-w )/g)].map(([, name]) => name));
    assert.ok(asked.length > 20, `${asked.length} commands`);
    assert.deepEqual([...new Set(asked)].filter((name) => !(name in scripts)), []); // prettier-ignore
  });

  it('gaussian-splat page makes a page, and leaves alone one that is there', () => {
    assert.match(made.index, /<script type="module" src="cdn\/gaussian-splat\.min\.js"><\/script>/);
    assert.match(made.index, /<gaussian-splat src="mine%20%26%20yours\.ply" alt="mine &amp; yours" camera-controls>/);
    const files = readdirSync(made.folder, { recursive: true }) as string[];
    assert.ok(['mine & yours.ply', 'index.html', 'cdn/scene-worker.js'].every((name) => files.includes(name)));
    assert.deepEqual(files.filter((name) => /\.map$|onnxruntime/.test(name)), []); // prettier-ignore
    writeFileSync(join(made.folder, 'index.html'), 'mine');
    const { stdout } = makePage(made.folder);
    assert.equal(readFileSync(join(made.folder, 'index.html'), 'utf8'), 'mine');
    assert.match(stdout, /exists and was not changed[\s\S]*<script type="module"[\s\S]*<gaussian-splat src=/);
  });

  it('the program around the renderer draws on its canvas', { timeout: 200_000 }, async () => {
    const [program, ...others] = snippets('ts').filter(({ code }) => code.includes('requestAnimationFrame'));
    assert.deepEqual(others, []);
    const { outputFiles } = await build({
      stdin: { contents: program.code, loader: 'ts', resolveDir: root },
      ...{ bundle: true, format: 'esm', target: 'es2022', write: false, outdir: '/', splitting: true, entryNames: 'program' },
    }); // prettier-ignore
    const open = await openSite();
    try {
      const { tab, faults } = await open.visit('/docs/', { width: 640, height: 400 });
      const { origin } = new URL(tab.url());
      await serveScenes(tab, origin);
      for (const { path, text } of outputFiles) {
        await tab.route(`${origin}${path}`, (route) => route.fulfill({ contentType: 'text/javascript', body: text }));
      }
      const body =
        '<!doctype html><title>Program</title><link rel="icon" href="data:,"><canvas width="120" height="90"></canvas><script type="module" src="/program.js"></script>';
      await tab.route(`${origin}/program.html`, (route) => route.fulfill({ contentType: 'text/html', body }));
      await tab.goto(`${origin}/program.html`);
      const isRed = (data: Buffer, i: number): boolean => data[i] > 150 && data[i + 1] < 80 && data[i + 2] < 80;
      const hasRed = async (): Promise<boolean> => {
        const { data } = PNG.sync.read(await tab.locator('canvas').screenshot());
        return Array.from({ length: data.length / 4 }, (_, i) => isRed(data, 4 * i)).includes(true);
      };
      const end = Date.now() + 120_000;
      while (!(await hasRed()) && faults.length === 0 && Date.now() < end) await tab.waitForTimeout(500);
      assert.deepEqual([await hasRed(), faults], [true, []], 'red is what stands at +x of the compass');
    } finally {
      await open.close();
    }
  });

  it('HTML shows an image', { timeout: 200_000 }, async () => {
    // Children of the element are opened by tests/element/browser/scenes.test.ts.
    const copied = snippets('html').filter(
      ({ code }) =>
        code.includes('<gaussian-splat') && !code.includes('<splat-') && (isFull || !code.includes('.onnx')),
    );
    const all = [...copied, { place: 'gaussian-splat page', language: 'html', code: made.index }];
    assert.ok(all.length > 5, `${all.length} snippets`);
    const open = await openSite();
    try {
      const { tab, faults } = await open.visit('/docs/', { width: 640, height: 900 });
      const { origin } = new URL(tab.url());
      await serveScenes(tab, origin);
      await tab.route(`${origin}/copied.html`, (route) =>
        route.fulfill({ contentType: 'text/html', body: pageOf(all, origin) }),
      );
      await tab.goto(`${origin}/copied.html`);
      const states = await stateOf(tab);
      assert.deepEqual(states.map((state, i) => ({ place: all[i]?.place, ...state })), all.map(wantedOf)); // prettier-ignore
      assert.deepEqual(faults, []);
    } finally {
      await open.close();
    }
  });
});

const fixture = (path: string): Buffer => readFileSync(join(root, 'tests', path));

/** A small scene of the right kind is served at every address in a snippet. */
async function serveScenes(tab: Page, origin: string): Promise<void> {
  const headers = { 'access-control-allow-origin': '*' };
  await tab.route(/\/(skull|scene|garden|room|apartment|hall|study|mine%20%26%20yours)\.(ply|spz|glb)$/, (route) =>
    route.fulfill({ headers, body: fixture('element/browser/fixtures/compass.ply') }),
  );
  await tab.route(/\/copied\/|^https:\/\/[a-z]+\.example\//, async (route) => {
    const name = new URL(route.request().url()).pathname.split('/').pop()!;
    if (name.endsWith('.min.js')) return route.fulfill({ headers: { ...headers, location: `${origin}/cdn/${name}` }, status: 302 }); // prettier-ignore
    return route.fallback();
  });
  await tab.route(/\/skull\.(webp|jpg)$/, (route) =>
    route.fulfill({ path: join(root, 'demo/scenes/skull-poster.webp') }),
  );
  // Visitors begin within the small scene, at its height, in the middle of a square.
  const layers = [new Float32Array(40 * 40).fill(-1.6)];
  const map = encodeFloorMap({ cell: 0.1, corner: [-2, -2], width: 40, depth: 40, layers, step: 0.3, start: [0, -1.6, 0], area: 16 }); // prettier-ignore
  await tab.route(/\/(hall|study)\.floor$/, (route) => route.fulfill({ body: Buffer.from(map) }));
  const clip = await clipOf(fountain({ splats: 300, frames: 8, framesPerSecond: 10 }), {
    frames: 8,
    framesPerGroup: 4,
  });
  await tab.route('**/fountain.gsv', (route) => route.fulfill({ body: Buffer.from(clip.bytes) }));
  await tab.route('**/fountain.mp3', (route) => route.fulfill({ contentType: 'audio/wav', body: silence() }));
  await tab.route('**/fountain.vtt', (route) => route.fulfill({ contentType: 'text/vtt', body: 'WEBVTT\n' }));
  const dancer = { gaussianSplatSequence: 1, framesPerSecond: 2, frames: 'dancer-{1}.splat', count: 2 };
  await tab.route('**/dancer.json', (route) => route.fulfill({ body: JSON.stringify(dancer) }));
  await tab.route('**/dancer-*.splat', (route) => route.fulfill({ body: fixture('element/browser/fixtures/compass.splat') })); // prettier-ignore
  await tab.route('**/style.onnx', (route) => route.fulfill({ body: fixture('fixtures/generators/post-fixed.onnx') }));
  await tab.route(/\/(walker|ball)\.onnx$/, (route) => route.fulfill({ body: fixture('fixtures/generators/packed.onnx') })); // prettier-ignore
}

/** A second of silence: WAV of 8,000 samples of 8 bits. */
function silence(): Buffer {
  const wave = Buffer.alloc(44 + 8000, 128);
  wave.write('RIFF', 0);
  wave.writeUInt32LE(36 + 8000, 4);
  wave.write('WAVEfmt ', 8);
  wave.writeUInt32LE(16, 16);
  wave.writeUInt16LE(1, 20); // PCM
  wave.writeUInt16LE(1, 22); // channels
  wave.writeUInt32LE(8000, 24); // samples a second
  wave.writeUInt32LE(8000, 28); // bytes a second
  wave.writeUInt16LE(1, 32); // bytes a sample
  wave.writeUInt16LE(8, 34); // bits
  wave.write('data', 36);
  wave.writeUInt32LE(8000, 40);
  return wave;
}

/** All of them on one page, each in a frame of its own document would be a device each: here they share one, as on any page. */
function pageOf(all: readonly Snippet[], origin: string): string {
  const sections = all.map(({ code }) => {
    const body = code
      .replace(/<!doctype html>|<title>.*?<\/title>|<meta[^>]*>|<style>[\s\S]*?<\/style>/g, '')
      .replace(/<script[^>]*gaussian-splat\.min\.js[\s\S]*?<\/script>/g, '')
      // Alone on its page a script means the page's first element; here it means that of its section.
      .replaceAll(
        "document.querySelector('gaussian-splat')",
        "document.currentSection().querySelector('gaussian-splat')",
      );
    return `<section>${body}</section>`;
  });
  return `<!doctype html><title>Copied</title><link rel="icon" href="data:,">
    <style>section { display: inline-block; width: 120px } gaussian-splat { display: block; width: 120px; height: 90px }</style>
    <script type="module" src="${origin}/cdn/gaussian-splat.min.js"></script>
    <script>
      const scripts = () => [...document.querySelectorAll('section script[type=module]')];
      let next = 0;
      document.currentSection = () => scripts()[next++].closest('section');
    </script>${sections.join('\n')}`;
}

interface State {
  readonly shown: boolean;
  readonly error: string;
  readonly covered: boolean;
  readonly plays: boolean;
}

const wantedOf = ({ place, code }: Snippet): State & { place: string } => ({
  ...{ place, shown: true, error: '', covered: true },
  plays: /\.play\(\)|autoplay/.test(code),
});

/** Checks for each section: its scene is visible, the image is not empty, its time runs. */
function stateOf(tab: Page): Promise<State[]> {
  return tab.evaluate(async () => {
    interface Splat extends HTMLElement {
      readonly ready: Promise<void>;
      readonly loaded: boolean;
      readonly error: { readonly message: string } | null;
      readonly paused: boolean;
      toBlob(): Promise<Blob>;
    }
    await customElements.whenDefined('gaussian-splat');
    const states = [];
    for (const scene of document.querySelectorAll<Splat>('section gaussian-splat')) {
      scene.scrollIntoView();
      await scene.ready;
      if (!scene.loaded) {
        states.push({ shown: false, error: scene.error?.message ?? 'no scene', covered: false, plays: false });
        continue;
      }
      const image = await createImageBitmap(await scene.toBlob());
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, image.width, image.height);
      const covered = data.some((value, i) => i % 4 === 3 && value > 128);
      states.push({ shown: scene.loaded, error: scene.error?.message ?? '', covered, plays: !scene.paused });
    }
    return states;
  });
}
