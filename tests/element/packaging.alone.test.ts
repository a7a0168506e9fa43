import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));
const isBuilt = existsSync(`${root}packages/element/cdn/gaussian-splat.min.js`);

interface SizeModule {
  readonly BUDGET: number;
  readonly SPZ_BUDGET: number;
  readonly bytesOf: (scripts: readonly string[]) => number;
  readonly scriptsForPly: () => string[];
  readonly scriptsForSpz: () => string[];
}

test(
  'what a page with a PLY scene fetches stays within 92,000 bytes of gzip',
  { skip: isBuilt ? false : 'no CDN build: npm run build' },
  async (t) => {
    const sizes = (await import(`${root}packages/element/scripts/size.mjs`)) as SizeModule;
    const files = sizes.scriptsForPly();
    assert.ok(files.includes('gaussian-splat.min.js') && files.includes('scene-worker.js'), files.join());
    assert.ok(files.length >= 3, 'the PLY reader is among them');
    assert.ok(!files.some((file) => file.includes('spz')), 'and no other reader');
    const bytes = sizes.bytesOf(files);
    t.diagnostic(`${bytes} bytes of gzip in ${files.length} files`);
    assert.ok(bytes < sizes.BUDGET, `${bytes} bytes`);
  },
);

test(
  'what a page with an SPZ scene fetches until its first image stays within 123 kB of gzip',
  { skip: isBuilt ? false : 'no CDN build: npm run build' },
  async (t) => {
    const sizes = (await import(`${root}packages/element/scripts/size.mjs`)) as SizeModule;
    const files = sizes.scriptsForSpz();
    const bytes = sizes.bytesOf(files);
    t.diagnostic(`${bytes} bytes of gzip in ${files.length} files`);
    assert.ok(files.length <= 24, `${files.length} requests: small modules that are loaded together are one chunk`);
    assert.ok(bytes < sizes.SPZ_BUDGET, `${bytes} bytes`);
  },
);

test(
  'no script of the CDN build asks for a source map, because the package has none',
  { skip: isBuilt ? false : 'no CDN build: npm run build' },
  () => {
    const cdn = `${root}packages/element/cdn/`;
    const scripts = readdirSync(cdn, { recursive: true, encoding: 'utf8' }).filter((file) => file.endsWith('.js'));
    const asking = scripts.filter((file) => readFileSync(cdn + file, 'utf8').includes('\n//# sourceMappingURL='));
    assert.deepEqual(asking, []);
  },
);

test(
  'bundlers of apps keep imports of addresses that only a page knows',
  { skip: isBuilt ? false : 'no CDN build: npm run build' },
  () => {
    const dist = `${root}packages/element/dist/`;
    const scripts = readdirSync(`${dist}production`, { recursive: true, encoding: 'utf8' })
      .filter((file) => file.endsWith('.js'))
      .map((file) => `production/${file}`);
    let found = 0;
    for (const script of [...scripts, 'loading/scene-worker.bundle.js']) {
      const code = readFileSync(dist + script, 'utf8');
      for (const [, comments] of code.matchAll(/\bimport\(((?:\/\*.*?\*\/\s*)*)[\w$]+\)/g)) {
        assert.match(comments, /@vite-ignore.*webpackIgnore: true/, `${script}: an import that webpack warns of`);
        found++;
      }
    }
    assert.ok(found >= 3, `${found} such imports`);
  },
);

test(
  'integrity.json has the hash of every script of the CDN build',
  { skip: isBuilt ? false : 'no CDN build: npm run build' },
  () => {
    const cdn = `${root}packages/element/cdn/`;
    const hashes = JSON.parse(readFileSync(`${cdn}integrity.json`, 'utf8')) as Record<string, string>;
    const scripts = readdirSync(cdn, { recursive: true, encoding: 'utf8' }).filter((file) => /\.m?js$/.test(file));
    assert.ok(scripts.includes('gaussian-splat.min.js') && scripts.length > 10, scripts.join());
    assert.deepEqual(Object.keys(hashes).sort(), scripts.sort());
    for (const file of scripts) {
      const digest = createHash('sha384')
        .update(readFileSync(cdn + file))
        .digest('base64');
      assert.equal(hashes[file], `sha384-${digest}`, file);
    }
  },
);

/** Code that only some pages need, identified by words that occur nowhere else. */
const ELSEWHERE: Readonly<Record<string, string>> = {
  'manifests of streamed scenes': 'gaussian-splat-detail',
  'pages of streamed scenes': 'gs.requests.staging',
  'the stage that records their page requests': 'page_feedback',
  sequences: 'a path with {0001} in it',
  'headers of .ksplat': 'a .ksplat section header',
  'what is said of files that are no scene': 'a git-LFS pointer, which only names the real file',
  'the runtime of generators': 'onnxruntime-web',
};

test(
  'what only some pages need is in the CDN build, and no page with a PLY scene fetches it',
  { skip: isBuilt ? false : 'no CDN build: npm run build' },
  async () => {
    const { scriptsForPly } = (await import(`${root}packages/element/scripts/size.mjs`)) as SizeModule;
    const cdn = `${root}packages/element/cdn/`;
    const forPly = scriptsForPly();
    const scripts = readdirSync(cdn, { recursive: true, encoding: 'utf8' }).filter((file) => file.endsWith('.js'));
    for (const [what, words] of Object.entries(ELSEWHERE)) {
      const holders = scripts.filter((file) => readFileSync(cdn + file, 'utf8').includes(words));
      assert.ok(holders.length > 0, `${what}: nowhere`);
      assert.deepEqual(
        holders.filter((file) => forPly.includes(file)),
        [],
        what,
      );
    }
  },
);

/** A process of its own: here tsx and the test runner have long touched the global scope. */
function importInNode(specifier: string): { status: number | null; output: string } {
  const code = `const before = new Set(Reflect.ownKeys(globalThis));
    const module = await import('${specifier}');
    const added = Reflect.ownKeys(globalThis).filter((key) => !before.has(key)).map(String);
    console.log(JSON.stringify({ names: Object.keys(module), added }));`;
  const { status, stdout, stderr } = spawnSync(process.execPath, ['--input-type=module', '-e', code], {
    cwd: root,
    encoding: 'utf8',
  });
  return { status, output: stdout + stderr };
}

for (const specifier of ['@gaussian-splat/element', '@gaussian-splat/element/element.js']) {
  test(`${specifier} can be imported on a server`, () => {
    const { status, output } = importInNode(specifier);
    assert.equal(status, 0, output);
    assert.match(output, /"GaussianSplatElement"/);
    // Lit itself adds its version list, and stand-ins for two classes of the DOM.
    assert.doesNotMatch(output, /"(document|window|navigator|Worker)"/);
  });
}

test('the guide names every attribute, and no other', async () => {
  const { GaussianSplatElement } = await import('@gaussian-splat/element/element.js');
  const guide = readFileSync(`${root}docs/guide/attributes.md`, 'utf8');
  const [, table] = /<!-- attributes:([^]*?)<!-- end -->/.exec(guide) ?? [];
  const named = [...table.matchAll(/^\|([^|]*)\|/gm)].flatMap(([, cell]) =>
    [...cell.matchAll(/`([a-z0-9-]+)`/g)].map(([, name]) => name),
  );
  assert.deepEqual(named.sort(), [...GaussianSplatElement.observedAttributes].sort());
});
