/**
 * Commands on scenes and models of several files, and on what people mistype.
 * SECURITY.md: "Commands and the exporter read untrusted files, too".
 */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import {
  copyFileSync,
  existsSync,
  lstatSync,
  mkdirSync,
  mkdtempSync,
  readdirSync,
  readFileSync,
  rmSync,
  symlinkSync,
  writeFileSync,
} from 'node:fs';
import type { Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { tmpdir } from 'node:os';
import { basename, dirname, join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import type { GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { PNG } from 'pngjs';
import { gpuEnvironment } from '../../scripts/lib/gpu-environment.mjs';
import { buildGltf } from '../formats/support/gltf-writer.js';
import { smallCloud } from '../formats/support/small-cloud.js';
import { clipOf } from '../support/clips.js';
import { cloudOf } from '../support/clouds.js';
import { isLab, onlyInLab, someOf } from '../support/extent.js';
import { fixturePath } from '../support/generators.js';

const root = fileURLToPath(new URL('../../', import.meta.url));
const folder = mkdtempSync(join(tmpdir(), 'commands-'));
after(() => rmSync(folder, { recursive: true }));

const inFolder = (...path: string[]): string => join(folder, ...path);

/** Runs a command in the test's folder, as a script that npm has been asked for from another folder. */
const command = (...args: string[]): ReturnType<typeof commandIn> => commandIn({}, ...args);

function commandIn(more: NodeJS.ProcessEnv, ...args: string[]): { status: number | null; text: string } {
  const bin = join(root, 'packages/cli/bin/gaussian-splat.mjs');
  const env = { ...process.env, ...gpuEnvironment(), INIT_CWD: root, ...more };
  const { status, stdout, stderr } = spawnSync(process.execPath, [bin, ...args], {
    cwd: folder,
    encoding: 'utf8',
    env,
  });
  return { status, text: stdout + stderr };
}

/** Runs a command that must fail in a sentence. */
function refused(status: number, sentence: RegExp, ...args: string[]): void {
  const found = command(...args);
  assert.equal(found.status, status, found.text);
  assert.match(found.text, sentence);
  assert.doesNotMatch(found.text, /\n\s+at /, 'no stack');
  assert.ok(status !== 2 || found.text.split('\n').length < 16, 'the sentence stays in view above the usage');
}

const fixtures = join(root, 'tests/element/browser/fixtures');
const GLTF = buildGltf([[{ cloud: smallCloud(6, 1) }]], [{ mesh: 0 }], [0]);
/** The buffer of that glTF within its JSON. */
const OWN_BUFFER = {
  uri: `data:application/octet-stream;base64,${Buffer.from(GLTF.buffer).toString('base64')}`,
  byteLength: GLTF.buffer.length,
};

/** A glTF with its buffer beside it. */
function writeGltf(): void {
  const { json, buffer } = GLTF;
  mkdirSync(inFolder('gltf', 'parts'), { recursive: true });
  const buffers = [{ uri: 'parts/a%20b.bin', byteLength: buffer.length }];
  writeFileSync(inFolder('gltf', 'scene.gltf'), JSON.stringify({ ...json, buffers }));
  writeFileSync(inFolder('gltf', 'parts', 'a b.bin'), buffer);
  writeFileSync(inFolder('gltf', 'private.txt'), 'of no scene');
}

writeGltf();
const CAMERA = {
  ...{ width: 16, height: 12 },
  K: [[16, 0, 8], [0, 16, 6], [0, 0, 1]], // prettier-ignore
  worldToCamera: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]], // prettier-ignore
};
writeFileSync(inFolder('camera.json'), JSON.stringify(CAMERA));

/** Makes a page with a scene, and lists its files but the element's. */
function filesOfPage(scene: string): string[] {
  const { status, text } = command('page', scene, 'page', '--no-serve');
  assert.equal(status, 0, text);
  const files = (readdirSync(inFolder('page'), { recursive: true }) as string[]).filter((f) => !f.startsWith('cdn'));
  for (const file of files) assert.ok(!lstatSync(inFolder('page', file)).isSymbolicLink(), `${file}: a link`);
  rmSync(inFolder('page'), { recursive: true });
  return files.filter((file) => file.includes('.') && file !== 'index.html').sort();
}

test('gaussian-splat page brings the files that a scene or a model names, and no others', () => {
  for (const name of ['link.onnx', 'link.contract.json', 'external.onnx', 'external.weights'])
    copyFileSync(fixturePath(name), inFolder(name));
  assert.deepEqual(filesOfPage('gltf/scene.gltf'), ['gltf/parts/a b.bin', 'gltf/scene.gltf']);
  assert.deepEqual(filesOfPage('link.onnx'), ['link.contract.json', 'link.onnx']);
  assert.deepEqual(filesOfPage('external.onnx'), ['external.onnx', 'external.weights']);
});

test('gaussian-splat page --usdz also writes the splats as OpenUSD, and links them', async () => {
  const { status, text } = command('page', 'gltf/scene.gltf', 'page', '--no-serve', '--usdz');
  assert.equal(status, 0, text);
  const cloud = await readScene(readFileSync(inFolder('page', 'scene-ar.usdz')), { name: 'scene-ar.usdz' });
  assert.match(text, new RegExp(`scene-ar\\.usdz: ${cloud.count} of ${cloud.count} splats as OpenUSD`));
  assert.deepEqual(cloud.hints, { up: [0, 1, 0], metersPerUnit: 1 });
  assert.match(
    readFileSync(inFolder('page', 'index.html'), 'utf8'),
    / camera-controls ios-splats="scene-ar\.usdz" ar>/,
  );
  const refused = command('page', 'link.onnx', 'page', '--no-serve', '--usdz');
  assert.match(refused.text, /--usdz takes a scene file/);
  rmSync(inFolder('page'), { recursive: true });
});

test('gaussian-splat page brings what descriptions in JSON name, and what these name, and no others', () => {
  const write = (path: string, content: unknown): void => {
    mkdirSync(dirname(inFolder('json', path)), { recursive: true });
    writeFileSync(inFolder('json', path), typeof content === 'string' ? content : JSON.stringify(content));
  };
  const sog = { means: { files: ['means_l.webp', 'means_u.webp'] }, quats: { files: ['quats.webp'] } };
  const images = ['means_l.webp', 'means_u.webp', 'quats.webp'];
  for (const folder of ['', 'a/', 'sky/']) {
    write(`${folder}meta.json`, sog);
    for (const image of images) write(folder + image, 'pixels');
  }
  for (const bundle of ['b.sog', 'frame-09.spz', 'frame-10.spz', 'frame-11.spz', 'pages/0.bin', 'pages/1.bin'])
    write(bundle, 'splats');
  write('private.txt', 'of no scene');
  write('lod-meta.json', { lodLevels: 2, filenames: ['a/meta.json', 'b.sog'], environment: './sky/meta.json' });
  write('detail.json', { trees: [{ pages: [{ file: 'pages/0.bin' }, { file: 'pages/1.bin' }] }] });
  write('film.json', { gaussianSplatSequence: 1, framesPerSecond: 2, frames: 'frame-{09}.spz', count: 2 });
  const tile = (uri: string, more: object = {}): object => ({ content: { uri }, ...more });
  write('tileset.json', { root: tile('tiles/a%20b.glb?v=1', { children: [tile('sub/tileset.json')] }) });
  write('sub/tileset.json', { root: { contents: [{ uri: '../tiles/c.glb' }] } });
  for (const glb of ['tiles/a b.glb', 'tiles/c.glb']) write(glb, 'splats');
  const within = (folder: string): string[] => ['meta.json', ...images].map((name) => folder + name).sort();
  const expected: [string, string[]][] = [
    ['meta.json', within('')],
    ['lod-meta.json', [...within('a/'), 'b.sog', 'lod-meta.json', ...within('sky/')].sort()],
    ['detail.json', ['detail.json', 'pages/0.bin', 'pages/1.bin']],
    ['film.json', ['film.json', 'frame-09.spz', 'frame-10.spz']],
    ['tileset.json', ['sub/tileset.json', 'tiles/a b.glb', 'tiles/c.glb', 'tileset.json']],
  ];
  for (const [scene, files] of someOf(expected, 3)) {
    assert.deepEqual(
      filesOfPage(`json/${scene}`),
      files.map((file) => `json/${file}`),
    );
  }
});

test('gaussian-splat copies files, not links to them, none from outside of the folder, and says what it cannot copy', () => {
  mkdirSync(inFolder('links', 'scene'), { recursive: true });
  copyFileSync(join(fixtures, 'compass.ply'), inFolder('links', 'real.ply'));
  symlinkSync('../real.ply', inFolder('links', 'scene', 'a.ply'));
  assert.deepEqual(filesOfPage('links/scene/a.ply'), ['a.ply']);
  const buffers = [OWN_BUFFER, { uri: '../real.ply' }, { uri: 'a.ply?version=1#here' }, { uri: 'missing.bin' }];
  const images = [{ uri: 'c.ply' }];
  writeFileSync(inFolder('links', 'scene', 'a.gltf'), JSON.stringify({ ...GLTF.json, buffers, images }));
  writeFileSync(inFolder('links', 'scene', 'b.ply'), 'ply');
  symlinkSync('b.ply', inFolder('links', 'scene', 'c.ply'));
  assert.deepEqual(filesOfPage('links/scene/a.gltf'), ['scene/a.gltf', 'scene/c.ply']);
  const { text } = command('page', 'links/scene/a.gltf', 'page', '--no-serve');
  assert.match(
    text,
    /names files that were not copied: \.\.\/real\.ply \(outside of its folder\), a\.ply \(a link out of its folder\), missing\.bin \(missing\)/,
  );
  rmSync(inFolder('page'), { recursive: true });
  const outside = [{ uri: '../real.ply', byteLength: OWN_BUFFER.byteLength }];
  writeFileSync(inFolder('links', 'scene', 'out.gltf'), JSON.stringify({ ...GLTF.json, buffers: outside }));
  const place = /expected names of files in the folder of the scene, found "\.\.\/real\.ply".*\[decode\/unsupported\]/;
  refused(1, place, 'optimize', 'links/scene/out.gltf', '--format-only', '--out', 'links/out.ply');
});

test('gaussian-splat page copies no page and no script that a scene names', () => {
  const names = ['index.html', 'cdn/gaussian-splat.min.js', 'CDN/x.bin', 'a.bin'];
  mkdirSync(inFolder('evil', 'cdn'), { recursive: true });
  mkdirSync(inFolder('evil', 'CDN'), { recursive: true });
  for (const name of names) writeFileSync(inFolder('evil', name), 'of the scene');
  const buffers = [OWN_BUFFER, ...names.map((uri) => ({ uri }))];
  writeFileSync(inFolder('evil', 'a.gltf'), JSON.stringify({ ...GLTF.json, buffers }));
  const { status, text } = command('page', 'evil/a.gltf', 'page', '--no-serve');
  assert.equal(status, 0, text);
  for (const name of names.slice(0, 2)) {
    assert.notEqual(readFileSync(inFolder('page', name), 'utf8'), 'of the scene');
    assert.match(text, new RegExp(`${name.replaceAll('.', '\\.')} \\(a page or a script\\)`));
  }
  rmSync(inFolder('page'), { recursive: true });
  assert.deepEqual(filesOfPage('evil/a.gltf'), ['evil/CDN/x.bin', 'evil/a.bin', 'evil/a.gltf']);
});

test('gaussian-splat page copies no file that servers give a meaning to', () => {
  const names = ['.htaccess', '.user.ini', 'web.config', 'a.phtml', 'a.shtml', '_headers', 'a.php8', 'x/.env', 'a.ply'];
  mkdirSync(inFolder('names', 'x'), { recursive: true });
  for (const name of names) writeFileSync(inFolder('names', name), 'of the scene');
  const tiles = names.map((uri) => ({ content: { uri } }));
  writeFileSync(inFolder('names', 's.json'), JSON.stringify({ root: { children: tiles } }));
  assert.deepEqual(filesOfPage('names/s.json'), ['names/a.ply', 'names/s.json']);
});

test('the server of pages serves its folders, and no link out of them', async () => {
  mkdirSync(inFolder('served', 'in'), { recursive: true });
  writeFileSync(inFolder('served', 'in', 'a.txt'), 'inside');
  writeFileSync(inFolder('secret.txt'), 'outside');
  symlinkSync('in/a.txt', inFolder('served', 'near.txt'));
  symlinkSync('../secret.txt', inFolder('served', 'far.txt'));
  symlinkSync('..', inFolder('served', 'up'));
  symlinkSync('served', inFolder('mount'));
  const path = '../../packages/cli/src/lib/server.mjs';
  const { serve } = (await import(path)) as { serve: (mounts: Record<string, string>) => Promise<Server> };
  const server = await serve({ '/': inFolder('mount') });
  const { port } = server.address() as AddressInfo;
  const statusOf = async (path: string): Promise<number> => (await fetch(`http://localhost:${port}/${path}`)).status;
  const found = await Promise.all(
    ['in/a.txt', 'near.txt', 'far.txt', 'up/secret.txt', '%2e%2e/secret.txt'].map(statusOf),
  );
  server.close();
  assert.deepEqual(found, [200, 200, 404, 404, 404]);
});

test('gaussian-splat page takes a scene of several files from the folder of the page itself', () => {
  mkdirSync(inFolder('mine'));
  writeFileSync(inFolder('mine', 'meta.json'), '{ "means": { "files": ["means.webp"] } }');
  writeFileSync(inFolder('mine', 'means.webp'), 'pixels');
  const { status, text } = command('page', 'mine/meta.json', 'mine', '--no-serve');
  assert.equal(status, 0, text);
  assert.match(readFileSync(inFolder('mine', 'index.html'), 'utf8'), /<gaussian-splat src="meta.json" alt="mine"/);
});

test('gaussian-splat page reads what it publishes: meshes have their tag, and what no page can show is refused', () => {
  const mesh = { vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[3, 0, 1, 2]] }; // prettier-ignore
  const header = [
    'ply',
    'format ascii 1.0',
    'element vertex 3',
    ...['x', 'y', 'z'].map((axis) => `property float ${axis}`),
  ];
  const faces = ['element face 1', 'property list uchar int vertex_indices'];
  const rows = (lists: number[][]): string[] => lists.map((row) => row.join(' '));
  const text = (lines: string[]): string => `${lines.join('\n')}\n`;
  const compass = readFileSync(join(fixtures, 'compass.ply'));
  const files: Record<string, string | Buffer> = {
    'mesh.ply': text([...header, ...faces, 'end_header', ...rows(mesh.vertices), ...rows(mesh.faces)]),
    'points.ply': text([...header, 'end_header', ...rows(mesh.vertices)]),
    'empty.spz': '',
    'login.spz': '<!doctype html><title>Log in</title>',
    'photo.spz': Buffer.concat([Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), Buffer.alloc(64)]),
    'cut.ply': compass.subarray(0, compass.length - 30),
    'cut.onnx': readFileSync(fixturePath('packed.onnx')).subarray(0, 40),
    'empty.json': '{}',
    'mine.gsv': 'text',
  };
  mkdirSync(inFolder('read'));
  for (const [name, content] of Object.entries(files)) writeFileSync(inFolder('read', name), content);
  for (const name of ['textured.glb', 'lfs-pointer.ply', 'compass.splat'])
    copyFileSync(join(fixtures, name), inFolder('read', name));
  for (const name of ['post.onnx', 'post.contract.json', 'link.onnx'])
    copyFileSync(fixturePath(name), inFolder('read', name));
  const shown = ['textured.glb', 'mesh.ply', 'compass.splat'].map((name) => `read/${name}`);
  const { status, text: said } = command('page', ...shown, 'several', '--no-serve');
  assert.equal(status, 0, said);
  const page = readFileSync(inFolder('several', 'index.html'), 'utf8');
  assert.deepEqual(page.match(/<(gaussian-splat|splat-mesh)[^>]*>/g), [
    '<gaussian-splat alt="textured" camera-controls>',
    '<splat-mesh src="textured.glb">',
    '<gaussian-splat alt="mesh" camera-controls>',
    '<splat-mesh src="mesh.ply">',
    '<gaussian-splat src="compass.splat" alt="compass" camera-controls>',
  ]);
  const wrong: readonly [name: string, code: RegExp][] = [
    ['points.ply', /decode\/not-splats/],
    ['empty.spz', /decode\/empty/],
    ['login.spz', /decode\/html/],
    ['photo.spz', /a PNG image/],
    ['cut.ply', /decode\/truncated/],
    ['cut.onnx', /contract|decode/],
    ['post.onnx', /post-processor.*postprocess="post\.onnx"/],
    ['link.onnx', /\[contract\/inference\]/],
    ['empty.json', /decode\/unknown-format/],
    ['mine.gsv', /decode\/unknown-format/],
    ['lfs-pointer.ply', /git lfs pull/],
  ];
  for (const [name, code] of someOf(wrong, 3)) {
    refused(1, code, 'page', `read/${name}`, 'refused', '--no-serve');
    assert.equal(existsSync(inFolder('refused')), false, name);
  }
});

test('gaussian-splat page says in a sentence what it was asked wrongly', () => {
  copyFileSync(fixturePath('packed.onnx'), inFolder('LOUD.ONNX'));
  const wrong: readonly [RegExp, ...string[]][] = [
    [/scene and a folder are needed/, 'gltf/scene.gltf'],
    [/There is no file .*missing\.ply/, 'gltf/scene.gltf', 'missing.ply', 'page'],
    [/--single takes one scene/, 'gltf/scene.gltf', 'LOUD.ONNX', 'page', '--single'],
    [/two files scene\.gltf/, 'gltf/scene.gltf', `../${basename(folder)}/gltf/scene.gltf`, 'page'],
    [/'--prot'/, 'gltf/scene.gltf', 'page', '--prot', '80'],
    [/--port: expected .* found "abc"/, 'gltf/scene.gltf', 'page', '--port', 'abc'],
    [/camera\.json is a file/, 'gltf/scene.gltf', 'camera.json'],
  ];
  for (const [sentence, ...args] of someOf(wrong, 2)) {
    refused(2, sentence, 'page', ...args, '--no-serve');
  }
});

test('gaussian-splat page adds ONNX Runtime for a generator, for any case of its name', () => {
  copyFileSync(fixturePath('packed.onnx'), inFolder('LOUD.ONNX'));
  const { status, text } = command('page', 'LOUD.ONNX', 'loud', '--no-serve');
  assert.equal(status, 0, text);
  const runtime = readdirSync(inFolder('loud', 'cdn', 'onnxruntime')).filter((name) => /^ort.*m?js$|wasm$/.test(name));
  assert.deepEqual(runtime.sort(), [
    'ort-wasm-simd-threaded.asyncify.wasm',
    'ort-wasm-simd-threaded.jspi.wasm',
    'ort.jspi.bundle.min.mjs',
    'ort.webgpu.bundle.min.mjs',
  ]);
  const page = readFileSync(inFolder('loud', 'index.html'), 'utf8');
  assert.match(page, /src="LOUD\.ONNX" alt="LOUD" camera-controls autoplay loop>/, 'a model with a time plays');
  refused(1, /needs ONNX Runtime/, 'page', 'LOUD.ONNX', 'single', '--single');
});

test('what cannot be written, or would replace what is read, is said before the work', () => {
  const scene = readFileSync(inFolder('gltf', 'scene.gltf'));
  const cases: readonly [RegExp, ...string[]][] = [
    [/expected a command, found "toString"/, 'toString'],
    [/--out: expected another file than gltf\/scene\.gltf/, 'floor', 'gltf/scene.gltf', '--out', 'gltf/scene.gltf'],
    [/--out: the folder .*nowhere does not exist/, 'floor', 'gltf/scene.gltf', '--out', 'nowhere/a.floor'],
    [/--up: expected x, .* found "toString"/, 'floor', 'gltf/scene.gltf', '--out', 'a.floor', '--up', 'toString'],
    [/--out: the folder .*nowhere does not exist/, 'sequence', 'camera.json', '--out', 'nowhere/a.gsv'],
    [/--out: expected a file \.gsv/, 'sequence', 'camera.json', '--out', 'camera.json/a'],
    [/--min-psnr: expected 30 to 60/, 'sequence', 'camera.json', '--out', 'a.gsv', '--min-psnr', '90'],
    [/--per-file/, 'sequence', 'camera.json', '--out', 'a.gsv', '--per-file', '1'],
    [/--jobs: expected a whole number from 1 to 64/, 'sequence', 'camera.json', '--out', 'a.gsv', '--jobs', '0'],
    [/camera\.json is not a folder/, 'page', 'gltf/scene.gltf', 'camera.json/a', '--no-serve'],
    [/--images: expected with --gate/, 'optimize', 'a.ply', '--min-psnr', '40', '--images', '.', '--out', 'a.spz'],
    [/--out: .*found \.xyz/, 'optimize', 'a.ply', '--min-psnr', '40', '--out', 'a.xyz'],
    [/--out: .*camera\.json is not a folder/, 'video', 'gltf/scene.gltf', '--turntable', '--out', 'camera.json/a'],
  ];
  for (const [sentence, ...args] of someOf(cases, 2)) refused(2, sentence, ...args);
  assert.deepEqual(readFileSync(inFolder('gltf', 'scene.gltf')), scene);
});

test('a value may begin with a dash, and what a command cannot do is said without a stack', () => {
  refused(
    1,
    /scene\.gltf has no floor: check --up/,
    'floor',
    'gltf/scene.gltf',
    '--out',
    'a.floor',
    '--up',
    '-z',
    '--near',
    '-1,0,2',
    '--unit',
    '1mm',
  );
  const { status, text } = command('floor', '-h');
  assert.deepEqual([status, /--near X,Y,Z/.test(text)], [0, true], text);
});

test('gaussian-splat render draws a scene of several files', () => {
  const { status, text } = command('render', 'gltf/scene.gltf', '--camera', 'camera.json', '--out', 'a.png');
  assert.equal(status, 0, text);
  assert.match(text, /^gltf\/scene\.gltf: 6 splats/m);
});

test('gaussian-splat render does not overwrite one image with the other', () => {
  const { status, text } = command(
    'render',
    'gltf/scene.gltf',
    '--camera',
    'camera.json',
    '--out',
    'b.png',
    '--float',
    './b.png',
  );
  assert.equal(status, 2, text);
  assert.match(text, /--float: expected another file than that of --out/);
});

test('gaussian-splat render says in a sentence what it was asked wrongly', () => {
  writeFileSync(inFolder('null.json'), 'null');
  writeFileSync(inFolder('views.json'), '{"views": 5}');
  const wrong: readonly [RegExp, scene: string, camera: string, out: string][] = [
    [/null\.json\.K: expected a 3x3 array/, 'gltf/scene.gltf', 'null.json', 'a.png'],
    [/expected a list of views in views\.json, found number/, 'gltf/scene.gltf', 'views.json', 'a.png'],
    [/--out: .*gltf is a folder/, 'gltf/scene.gltf', 'camera.json', 'gltf'],
    [
      /--out: expected another file than gltf\/scene\.gltf, which is never changed/,
      'gltf/scene.gltf',
      'camera.json',
      'gltf/scene.gltf',
    ],
    [/no such file .*none\.ply/, 'none.ply', 'camera.json', 'a.png'],
  ];
  for (const [sentence, scene, camera, out] of someOf(wrong, 2)) {
    const { status, text } = command('render', scene, '--camera', camera, '--view', '0', '--out', out);
    assert.notEqual(status, 0, text);
    assert.match(text, sentence);
    assert.doesNotMatch(text, /\n\s+at /, 'no stack');
  }
});

test(
  'gaussian-splat render measures depth and identity of several scenes, in three formats',
  { skip: onlyInLab },
  async () => {
    const scenes = ['gltf/scene.gltf', '--beside', 'gltf/scene.gltf'];
    const maps = ['--depth', 'd.npy', '--expected-depth', 'd.png', '--coverage', 'c.exr', '--ids', 'i.npy'];
    const { status, text } = command('render', ...scenes, '--camera', 'camera.json', ...maps);
    assert.equal(status, 0, text);
    const { width, height } = JSON.parse(readFileSync(inFolder('camera.json'), 'utf8')) as PNG;
    const npy = (name: string): { header: string; words: DataView } => {
      const bytes = readFileSync(inFolder(name));
      const length = 10 + bytes.readUInt16LE(8);
      assert.equal(length % 64, 0);
      return {
        header: bytes.toString('latin1', 10, length),
        words: new DataView(bytes.buffer, bytes.byteOffset + length),
      };
    };
    const [depth, ids] = [npy('d.npy'), npy('i.npy')];
    assert.match(depth.header, new RegExp(`'<f4'.*\\(${height}, ${width}\\)`));
    assert.match(ids.header, /'<u4'/);
    const exr = readFileSync(inFolder('c.exr'));
    // three reads luminance alone: the name of the channel, after that of the type and the length, becomes Y.
    assert.equal(exr.write('Y', exr.indexOf('chlist') + 11), 1);
    // @ts-expect-error: three has no types here
    const { FloatType } = await import('three');
    // @ts-expect-error: three has no types here
    const { EXRLoader } = await import('three/addons/loaders/EXRLoader.js');
    const loader = new EXRLoader().setDataType(FloatType);
    const { data, width: columns, height: rows } = loader.parse(Uint8Array.from(exr).buffer);
    assert.deepEqual([columns, rows], [width, height]);
    const png = PNG.sync.read(readFileSync(inFolder('d.png')), { skipRescale: true });
    const expected = png.data as unknown as Uint16Array;
    let seen = 0;
    for (let i = 0; i < width * height; i++) {
      const [id, median] = [ids.words.getUint32(4 * i, true), depth.words.getFloat32(4 * i, true)];
      // The loader's first row is the bottom one.
      const coverage = data[4 * ((height - 1 - Math.floor(i / width)) * width + (i % width))];
      assert.equal(coverage > 0, id > 0, `pixel ${i}: coverage ${coverage}, id ${id}`);
      assert.equal(median > 0, coverage >= 0.5, `pixel ${i}: coverage ${coverage}, depth ${median}`);
      if (median === 0) continue;
      seen++;
      // The first of two equal scenes is in front.
      assert.equal(id, 1);
      assert.ok(Math.abs(expected[4 * i] / 1000 - median) < 0.5, `${expected[4 * i]} mm and ${median} m`);
    }
    assert.ok(seen > 0, 'pixels with a depth');
    refused(2, /--ids: expected a file that ends in/, 'render', ...scenes, '--camera', 'camera.json', '--ids', 'i.jpg');
    refused(2, /--raster: expected tiles or auto, found quads/, 'render', ...scenes, '--camera', 'camera.json', '--ids', 'i.png', '--raster', 'quads'); // prettier-ignore
    // It draws all again.
    if (isLab)
    refused(1, /Z: expected values up to 0\.065535/, 'render', ...scenes, '--camera', 'camera.json', '--depth', 'd.png', '--depth-unit', '0.000001'); // prettier-ignore
  },
);

const hasFfmpeg = spawnSync('ffmpeg', ['-version']).error === undefined;

test('gaussian-splat video writes numbered frames of a turntable, with their alpha', () => {
  const turn = ['--turntable', '--size', '16x12', '--frames', '3'];
  const { status, text } = command('video', 'gltf/scene.gltf', ...turn, '--out', 'frames');
  assert.equal(status, 0, text);
  assert.match(text, /^frames: 3 frames of 16x12, 0\.1 s; 6 splats/m);
  const names = readdirSync(inFolder('frames')).sort();
  assert.deepEqual(names, ['frame-0000.png', 'frame-0001.png', 'frame-0002.png']);
  const frames = names.map((name) => PNG.sync.read(readFileSync(inFolder('frames', name))));
  assert.ok(frames.every(({ width, height }) => width === 16 && height === 12));
  assert.equal(frames[0].data[3], 0, 'a corner is transparent');
  assert.notDeepEqual(frames[0].data, frames[1].data, 'the camera moves');
  const fewer = [...turn.slice(0, -1), '2', '--out', 'frames'];
  refused(2, /has frames of another run, such as frame-0002\.png/, 'video', 'gltf/scene.gltf', ...fewer);
});

test(
  'gaussian-splat video plays a clip, whose last frame stays; render takes the moment of a clip alone',
  { skip: onlyInLab },
  async () => {
    const colors = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] as const; // prettier-ignore
    const ball = (frame: number): GaussianCloud =>
      cloudOf([{ position: [0, 0, 0], scale: 0.5, opacity: 1, color: colors[frame % 3] }]);
    const { bytes } = await clipOf(ball, { frames: 6, framesPerSecond: 10, framesPerGroup: 4 });
    writeFileSync(inFolder('ball.gsv'), bytes);
    const turn = ['--turntable', '--size', '16x12', '--fps', '5', '--frames', '5'];
    const { status, text } = command('video', 'ball.gsv', ...turn, '--out', 'played');
    assert.equal(status, 0, text);
    const brightest = readdirSync(inFolder('played')).map((name) => {
      const { data } = PNG.sync.read(readFileSync(inFolder('played', name)));
      const center = [...data.subarray(4 * (16 * 6 + 8))].slice(0, 3);
      return center.indexOf(Math.max(...center));
    });
    assert.deepEqual(brightest, [0, 2, 1, 2, 2], 'frames 0, 2, 4 of six, and the last');
    refused(2, /--time: expected a clip/, 'render', 'gltf/scene.gltf', '--camera', 'camera.json', '--time', '1', '--out', 'a.png'); // prettier-ignore
  },
);

test('gaussian-splat video writes WebM by ffmpeg', { skip: onlyInLab || (!hasFfmpeg && 'no ffmpeg here') }, () => {
  const turn = ['--turntable', '--size', '16x12', '--frames', '3'];
  const { status, text } = command('video', 'gltf/scene.gltf', ...turn, '--out', 'turn.webm');
  assert.equal(status, 0, text);
  // The number of EBML, which WebM begins with.
  assert.equal(readFileSync(inFolder('turn.webm')).readUInt32BE(0), 0x1a45dfa3);
  assert.deepEqual(
    readdirSync(folder).filter((name) => name.includes('.part')),
    [],
    'no half file stays',
  );
});

test('gaussian-splat video says in a sentence what it was asked wrongly', () => {
  writeFileSync(inFolder('no-views.json'), '{"views": 5}');
  const wrong: readonly [RegExp, ...string[]][] = [
    [/expected either --path or --turntable/, '--out', 'a'],
    [/--frames: expected a whole number from 1/, '--turntable', '--out', 'a', '--frames', '0.5'],
    [/expected a list of views/, '--path', 'no-views.json', '--out', 'a'],
    [/--size: expected two sides/, '--turntable', '--out', 'a', '--size', '0x5'],
    [/expected a folder, or a file that ends in \.mp4 or \.webm/, '--turntable', '--out', 'camera.json'],
    [/--out: expected even sides for \.mp4, found 15x12/, '--turntable', '--out', 'a.mp4', '--size', '15x12'],
  ];
  for (const [sentence, ...args] of someOf(wrong, 3)) {
    const { status, text } = command('video', 'gltf/scene.gltf', ...args);
    assert.notEqual(status, 0, text);
    assert.match(text, sentence);
    assert.doesNotMatch(text, /\n\s+at /, 'no stack');
  }
});

test('texts name a command as it was called: from a checkout, by npx, or as an installed program', () => {
  const called = {
    'gaussian-splat': 'npm run gaussian-splat --',
    npx: 'npx @gaussian-splat/cli',
    other: 'gaussian-splat',
  };
  for (const [npm_lifecycle_event, program] of Object.entries(called)) {
    copyFileSync(fixturePath('split.onnx'), inFolder('draft.onnx'));
    rmSync(inFolder('draft.contract.json'), { force: true });
    const env = { npm_lifecycle_event };
    assert.ok(
      commandIn(env, 'check', 'draft.onnx', '--draft').text.includes(`Then: ${program} check "draft.onnx" --run`),
    );
    assert.ok(commandIn(env, 'check', '--help').text.startsWith(`Usage: ${program} check MODEL`));
    assert.ok(commandIn(env, 'floor', '--help').text.startsWith(`usage: ${program} floor SCENE`));
    assert.ok(commandIn(env).text.startsWith(`usage: ${program} COMMAND`));
  }
});

test('gaussian-splat check reads paths as seen from where it was called', () => {
  const { status, text } = command('check', 'link.onnx');
  assert.equal(status, 0, text);
  assert.match(text, /keeps the contract/);
});
