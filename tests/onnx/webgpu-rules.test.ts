/** One rule set, one corpus: this checker finds the same faults in every file of the fixtures as the Python exporter's (test_placement.py). */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import { fileURLToPath } from 'node:url';
import { bytesSource, gpuFindings, miscomputedNodes, readOnnxHeader, WEBGPU_RULES } from '@gaussian-splat/core/onnx';
import { fixtureHeader } from '../support/generators.js';

const at = (path: string): string => fileURLToPath(new URL(`../${path}`, import.meta.url));
const expected = JSON.parse(readFileSync(at('fixtures/gpu-findings.json'), 'utf8')) as Record<string, string[][]>;

for (const [name, findings] of Object.entries(expected)) {
  test(`${name}: what leaves the GPU`, async () => {
    const header = await readOnnxHeader(bytesSource(readFileSync(at(`fixtures/${name}`)), name));
    const found = gpuFindings(header).map(({ kind, operator, tensor }) => [kind, operator, tensor]);
    assert.deepEqual(found.sort(byText), [...findings].sort(byText));
  });
}

const byText = (a: readonly string[], b: readonly string[]): number => (String(a) < String(b) ? -1 : 1);

test('the rules of the exporter are the copy of these', () => {
  const copy = readFileSync(at('../packages/exporter/src/gaussian_exporter/webgpu_rules.json'), 'utf8');
  assert.deepEqual(JSON.parse(copy), JSON.parse(JSON.stringify(WEBGPU_RULES)), 'node scripts/write-webgpu-rules.mjs');
});

test('convolutions that come out wrong are seen through what stands before their weights', async () => {
  const forms = 'constant cast dequantized identity reshaped transposed strided line'.split(' ');
  for (const form of forms) {
    const [wrong] = miscomputedNodes(await fixtureHeader(`spelled-${form}.onnx`));
    assert.match(wrong?.reason ?? '', /6 channels to 8 wrongly/, form);
  }
  for (const form of ['grouped', 'pointwise']) {
    assert.deepEqual(miscomputedNodes(await fixtureHeader(`spelled-${form}.onnx`)), [], form);
  }
});
