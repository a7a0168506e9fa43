/** Memory of models that is known before their first run, against shapes written here and against file sizes. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { contractReport } from '@gaussian-splat/core/contract';
import { modelMemory, type OnnxDim, type OnnxNode, type OnnxTensor } from '@gaussian-splat/core/onnx';
import { fixtureHeader } from '../support/generators.js';
import { headerWith, tensor } from './support.js';

const node = (operator: string, inputs: string[], outputs: string[], rest: Partial<OnnxNode> = {}): OnnxNode => ({
  ...{ name: '', operator, inputs, outputs, isInner: false },
  ...rest,
});
const values = (...entries: [name: string, dims: OnnxDim[]][]): Map<string, OnnxTensor> =>
  new Map(entries.map(([name, dims]) => [name, tensor(name, dims)]));

test('weights, constants and computed tensors, each once', () => {
  const header = headerWith([tensor('time', [1])], [tensor('out', [8, 13])], {
    stored: new Map([
      ['w', { dtype: 'float16', dims: [100, 13] }],
      ['q', { dtype: 'int4', dims: [7] }],
    ]),
    nodes: [
      node('Constant', [], ['c'], { value: { dtype: 'float32', dims: [50_000] } }),
      node('Conv', ['time', 'w'], ['large']),
      node('NonZero', ['large'], ['some']),
      node('Add', ['inner', 'inner'], ['inside'], { isInner: true }),
      node('MatMul', ['some', 'c'], ['out']),
    ],
    values: values(['large', [1, 64, 10, 10]], ['some', ['n', 3]], ['inside', [1_000_000]]),
  });
  assert.deepEqual(modelMemory(header), {
    // 1300 halves, seven of four bits, and the constant, which is no computed tensor.
    weightBytes: 2600 + 4 + 200_000,
    largestKnownTensorBytes: 4 * 6400,
    unknownTensors: 1,
  });
});

test('no size is invented: without shapes there is no largest tensor', () => {
  const header = headerWith([], [tensor('out', ['n', 13])], { nodes: [node('NonZero', ['x'], ['out'])] });
  const memory = modelMemory(header);
  assert.deepEqual(memory, { weightBytes: 0, largestKnownTensorBytes: null, unknownTensors: 1 });
  const [[, text]] = contractReport(header, undefined)[0].rows.filter(([name]) => name === 'memory');
  assert.equal(text, 'weights 0 bytes, 1 tensors of a size that only a run determines');
});

test('files: what onnx says of them, and an output that is folded counts', async () => {
  // Sums over `graph.initializer` and `Constant` by the package onnx.
  const sums = { 'split.onnx': 3588, 'visionary-sh.onnx': 14_856, 'packed-sh-half.onnx': 5640 };
  for (const [name, sum] of Object.entries(sums)) {
    const header = await fixtureHeader(name);
    const memory = modelMemory(header);
    assert.equal(memory.weightBytes, sum, name);
    assert.ok(memory.weightBytes < header.byteLength, name);
  }
  // Its rotations depend only on constants, and are its largest tensor: [64, 4] floats.
  assert.equal(modelMemory(await fixtureHeader('split.onnx')).largestKnownTensorBytes, 4 * 64 * 4);
  // Its output has a symbolic axis, and depends only on constants, too.
  assert.ok(modelMemory(await fixtureHeader('packed-sh-half.onnx')).unknownTensors > 0);
});

test('each node is evaluated once, also if tensors are used twice', () => {
  const sums = Array.from({ length: 17 }, (_, k) => node('Add', [`t${k}`, `t${k}`], [`t${k + 1}`]));
  const shapes = Array.from({ length: 2_000 }, (_, k) => node('Shape', ['t16'], [`s${k}`]));
  const header = headerWith([tensor('t0', ['n', 3])], [tensor('t17', ['n', 3])], { nodes: [...sums, ...shapes] });
  const start = process.cpuUsage();
  assert.equal(modelMemory(header).largestKnownTensorBytes, null);
  const { user } = process.cpuUsage(start);
  assert.ok(user < 1e6, `${user / 1e3} ms`);
});
