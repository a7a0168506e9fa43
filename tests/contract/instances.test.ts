/** The axis of instances: its required position, the remaining shapes, and how values of several become those of one. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import {
  checkContract,
  gaussianLayout,
  ofInstances,
  oneInstance,
  outputsOfInstance,
  parseContract,
  type Contract,
} from '@gaussian-splat/core/contract';
import type { OnnxTensor } from '@gaussian-splat/core/onnx';
import { bindInputs, groupInstances, inputsOfInstances, stackInputs, type Inputs } from '@gaussian-splat/generator';
import { assertHelpful, brief, faultsOf, headerWith, PACKED, tensor } from './support.js';

const MANY: Contract = { ...PACKED, instances: { axis: 'B', most: 8 } };
const TIMES = tensor('time', ['B', 1]);
const GAUSSIANS = tensor('gaussians', ['B', 10, 13]);
const SEED = tensor('seed', [1], 'int32');
const withSeed: Contract = { ...MANY, inputs: { ...MANY.inputs, seed: { role: 'seed' } } };

type Declared = readonly [name: string, dims: OnnxTensor['dims'], dtype?: OnnxTensor['dtype']];

/** The corpus of both checkers: packages/exporter/tests/test_instances.py holds the other one against it. */
const { contract: base, cases } = JSON.parse(
  readFileSync(new URL('../fixtures/instances.json', import.meta.url), 'utf8'),
) as {
  readonly contract: Contract;
  readonly cases: readonly {
    readonly what: string;
    readonly inputs: readonly Declared[];
    readonly outputs: readonly Declared[];
    /** Changes of the contract; null for a field that is not there. */
    readonly contract?: object;
    readonly faults: readonly string[];
  }[];
};

for (const { what, inputs, outputs, contract, faults } of cases) {
  test(`instances: ${what}`, () => {
    const given = JSON.stringify({ ...base, ...contract }, (_, value: unknown) => value ?? undefined);
    const [declaredInputs, declaredOutputs] = [inputs, outputs].map((list) => list.map((each) => tensor(...each)));
    const found = checkContract(headerWith(declaredInputs, declaredOutputs), parseContract(given));
    assertHelpful(found);
    assert.deepEqual(brief(found), faults);
  });
}

test('the contract says which axis and how many, both', () => {
  assert.deepEqual(parseContract(JSON.stringify(MANY)).instances, { axis: 'B', most: 8 });
  const wrong = [
    { axis: 'B' },
    { most: 2 },
    { axis: 'B', most: 0 },
    { axis: '', most: 2 },
    { axis: 'B', most: 2, least: 1 },
  ];
  for (const instances of wrong) {
    assert.deepEqual(
      faultsOf(() => parseContract({ ...PACKED, instances })).map(({ code }) => code),
      ['contract/schema'],
    );
  }
});

test('shapes of one, of several; the layout is of one', () => {
  const header = headerWith([TIMES, SEED], [GAUSSIANS]);
  const one = oneInstance(header, withSeed);
  assert.deepEqual(
    [...one.inputs, ...one.outputs].map(({ dims }) => dims),
    [[1], [1], [10, 13]],
  );
  const three = ofInstances(header, withSeed, 3);
  assert.deepEqual(
    [...three.inputs, ...three.outputs].map(({ dims }) => dims),
    [[3, 1], [1], [3, 10, 13]],
  );
  assert.equal(oneInstance(header, PACKED), header);
  const layout = gaussianLayout(header, withSeed)!;
  assert.deepEqual([layout.capacity, layout.isDynamic, layout.attributes[0].rowStride], [10, false, 13]);
});

test('inputs of several are rows of one; those who do not share what is shared run apart', () => {
  const header = headerWith([TIMES, SEED], [GAUSSIANS]);
  const one = oneInstance(header, withSeed);
  const varying = inputsOfInstances(header, withSeed);
  assert.deepEqual([...varying], ['time']);
  const member = (timeSeconds: number, seed: number): { inputs: Inputs } => ({
    inputs: bindInputs(one, withSeed, { timeSeconds, seed }),
  });
  const members = [member(0, 1), member(1, 2), member(2, 1), member(3, 1), member(4, 1)];
  const times = groupInstances(members, varying, 3).map((group) => group.map((each) => members.indexOf(each as never)));
  assert.deepEqual(times, [[0, 2, 3], [1], [4]]);
  const stacked = stackInputs([members[0].inputs, members[2].inputs], varying, 4);
  assert.deepEqual(stacked, {
    time: { dtype: 'float32', dims: [4, 1], data: Float32Array.of(0, 2, 2, 2) },
    seed: { dtype: 'int32', dims: [1], data: Int32Array.of(1) },
  });
});

test('outputs of one are a view of those of several', () => {
  const data = Float32Array.from({ length: 12 }, (_, i) => i);
  const outputs = { a: { dtype: 'float32', dims: [3, 2, 2], data }, c: { dtype: 'int32', dims: [3], data: [7, 8, 9] } };
  assert.deepEqual(outputsOfInstance(outputs, 1), {
    a: { dtype: 'float32', dims: [2, 2], data: Float32Array.of(4, 5, 6, 7) },
    c: { dtype: 'int32', dims: [], data: [8] },
  });
});
