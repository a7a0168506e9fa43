import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import type { GaussianSplatError } from '../../packages/core/src/index.js';
import { folderBeside } from '../../packages/generator/src/runtime/load-runtime.js';

const packages = fileURLToPath(new URL('../../packages/', import.meta.url));
const isBuilt = existsSync(`${packages}generator/dist`);

test('no built package names a folder as bundlers read the name of a file', { skip: !isBuilt && 'not built' }, () => {
  const found: string[] = [];
  for (const name of readdirSync(packages).filter((name) => existsSync(`${packages}${name}/dist`))) {
    const scripts = readdirSync(`${packages}${name}/dist`, { recursive: true, encoding: 'utf8' });
    for (const script of scripts.filter((path) => path.endsWith('.js'))) {
      const text = readFileSync(`${packages}${name}/dist/${script}`, 'utf8');
      if (/new URL\(\s*(['"`])[^'"`]*\/\1,\s*import\.meta\.url/.test(text)) found.push(`${name}/${script}`);
    }
  }
  assert.deepEqual(found, []);
});

test('the runtime is loaded from the folder of its module', () => {
  assert.equal(folderBeside('https://cdn.example/a/gaussian-splat.min.js'), 'https://cdn.example/a/onnxruntime/');
  assert.equal(folderBeside('file:///a/load-runtime.js'), 'file:///a/onnxruntime/', 'in Node');
});

test('where a bundler has left no address, runtimeLocation is asked for', () => {
  Object.defineProperty(globalThis, 'location', { value: { protocol: 'https:' }, configurable: true });
  after(() => Reflect.deleteProperty(globalThis, 'location'));
  for (const module of [undefined, '', 'file:///home/a/load-runtime.js']) {
    assert.throws(
      () => folderBeside(module),
      (error: GaussianSplatError) => error.code === 'network/unreachable' && /runtimeLocation/.test(error.remedy),
    );
  }
});
