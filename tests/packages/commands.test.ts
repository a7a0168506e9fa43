/** Commands on scenes and models of several files, and on what people mistype. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { gpuEnvironment } from '../../scripts/lib/gpu-environment.mjs';
import { buildGltf } from '../formats/support/gltf-writer.js';
import { smallCloud } from '../formats/support/small-cloud.js';
import { fixturePath } from '../support/generators.js';

const root = fileURLToPath(new URL('../../', import.meta.url));
const folder = mkdtempSync(join(tmpdir(), 'commands-'));
after(() => rmSync(folder, { recursive: true }));

const inFolder = (...path: string[]): string => join(folder, ...path);

/** As npm runs a script for somebody who is in the folder of the test. */
function command(script: string, ...args: string[]): { status: number | null; text: string } {
  const { status, stdout, stderr } = spawnSync(process.execPath, [`scripts/${script}.mjs`, ...args], {
    cwd: root,
    encoding: 'utf8',
    env: { ...process.env, ...gpuEnvironment(), INIT_CWD: folder },
  });
  return { status, text: stdout + stderr };
}

/** A glTF with its buffer beside it. */
function writeGltf(): void {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(6, 1) }]], [{ mesh: 0 }], [0]);
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

test('npm run page brings the files that a scene or a model names, and no others', () => {
  for (const name of ['link.onnx', 'link.contract.json', 'external.onnx', 'external.weights'])
    copyFileSync(fixturePath(name), inFolder(name));
  const bring = (scene: string): string[] => {
    const { status, text } = command('page', scene, 'page', '--no-serve');
    assert.equal(status, 0, text);
    const files = (readdirSync(inFolder('page'), { recursive: true }) as string[]).filter((f) => !f.startsWith('cdn'));
    rmSync(inFolder('page'), { recursive: true });
    return files.sort();
  };
  assert.deepEqual(bring('gltf/scene.gltf'), ['index.html', 'parts', 'parts/a b.bin', 'scene.gltf']);
  assert.deepEqual(bring('link.onnx'), ['index.html', 'link.contract.json', 'link.onnx']);
  assert.deepEqual(bring('external.onnx'), ['external.onnx', 'external.weights', 'index.html']);
});

test('npm run page takes a scene of several files from the folder of the page itself', () => {
  mkdirSync(inFolder('mine'));
  writeFileSync(inFolder('mine', 'meta.json'), '{}');
  const { status, text } = command('page', 'mine/meta.json', 'mine', '--no-serve');
  assert.equal(status, 0, text);
  assert.match(readFileSync(inFolder('mine', 'index.html'), 'utf8'), /<gaussian-splat src="meta.json" alt="mine"/);
});

test('npm run page says in a sentence what it was asked wrongly', () => {
  const wrong: readonly [RegExp, ...string[]][] = [
    [/scene and a folder are needed/, 'gltf/scene.gltf'],
    [/scene and a folder are needed/, 'gltf/scene.gltf', 'page', 'more'],
    [/'--prot'/, 'gltf/scene.gltf', 'page', '--prot', '80'],
    [/--port: expected .* found "abc"/, 'gltf/scene.gltf', 'page', '--port', 'abc'],
    [/gltf is a folder/, 'gltf', 'page'],
    [/camera\.json is a file/, 'gltf/scene.gltf', 'camera.json'],
    [/lies in the scene's folder/, 'mine/meta.json', 'mine/page'],
  ];
  for (const [sentence, ...args] of wrong) {
    const { status, text } = command('page', ...args, '--no-serve');
    assert.equal(status, 1, text);
    assert.match(text, sentence);
    assert.doesNotMatch(text, /\n\s+at /, 'no stack');
  }
});

test('npm run render draws a scene of several files', () => {
  const { status, text } = command('render-image', 'gltf/scene.gltf', '--camera', 'camera.json', '--out', 'a.png');
  assert.equal(status, 0, text);
  assert.match(text, /^gltf\/scene\.gltf: 6 splats/m);
});

test('npm run render says in a sentence what it was asked wrongly', () => {
  writeFileSync(inFolder('null.json'), 'null');
  writeFileSync(inFolder('views.json'), '{"views": 5}');
  const wrong: readonly [RegExp, scene: string, camera: string, out: string][] = [
    [/null\.json\.K: expected a 3x3 array/, 'gltf/scene.gltf', 'null.json', 'a.png'],
    [/expected a list of views in views\.json, found number/, 'gltf/scene.gltf', 'views.json', 'a.png'],
    [/expected a file, found a folder/, 'gltf', 'camera.json', 'a.png'],
    [/--out: .*gltf is a folder/, 'gltf/scene.gltf', 'camera.json', 'gltf'],
    [
      /--out: expected another file than gltf\/scene\.gltf, which is never changed/,
      'gltf/scene.gltf',
      'camera.json',
      'gltf/scene.gltf',
    ],
    [/no such file .*none\.ply/, 'none.ply', 'camera.json', 'a.png'],
  ];
  for (const [sentence, scene, camera, out] of wrong) {
    const { status, text } = command('render-image', scene, '--camera', camera, '--view', '0', '--out', out);
    assert.notEqual(status, 0, text);
    assert.match(text, sentence);
    assert.doesNotMatch(text, /\n\s+at /, 'no stack');
  }
});

test('npm run check reads paths as seen from where it was called', () => {
  const { status, text } = command('check', 'link.onnx');
  assert.equal(status, 0, text);
  assert.match(text, /keeps the contract/);
});
