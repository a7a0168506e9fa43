/** The axis of instances: its required position, the remaining shapes, and how values of several become those of one. */
import assert from 'node:assert/strict';
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
import { assertHelpful, brief, faultsOf, headerWith, PACKED, SPLIT, tensor } from './support.js';

const MANY: Contract = { ...PACKED, instances: { axis: 'B', most: 8 } };
const TIMES = tensor('time', ['B', 1]);
const GAUSSIANS = tensor('gaussians', ['B', 10, 13]);
const SEED = tensor('seed', [1], 'int32');
const withSeed: Contract = { ...MANY, inputs: { ...MANY.inputs, seed: { role: 'seed' } } };
const splitOutputs = (lead: OnnxTensor['dims']): OnnxTensor[] => [
  tensor('p', [...lead!, 10, 3]),
  tensor('s', [...lead!, 10, 3]),
  tensor('r', [...lead!, 10, 4]),
  tensor('h', [...lead!, 10, 9, 3]),
  tensor('o', [...lead!, 10, 1]),
  tensor('c', [...lead!], 'int32'),
];
const SPLIT_MANY: Contract = { ...SPLIT, inputs: PACKED.inputs, instances: { axis: 'B', most: 4 } };

const CASES: readonly [
  what: string,
  inputs: OnnxTensor[],
  outputs: OnnxTensor[],
  contract: Contract,
  faults: string[],
][] = [
  ['nothing wrong', [TIMES], [GAUSSIANS], MANY, []],
  ['an input that all share', [TIMES, SEED], [GAUSSIANS], withSeed, []],
  ['split, with a count', [TIMES], splitOutputs(['B']), SPLIT_MANY, []],
  ['an output without it', [TIMES], [tensor('gaussians', [10, 13])], MANY, ['instances gaussians']],
  [
    'an axis of another name',
    [TIMES],
    [tensor('gaussians', ['N', 10, 13])],
    MANY,
    ['instances gaussians', 'shape gaussians'],
  ],
  [
    'a size that all share',
    [TIMES],
    [tensor('gaussians', [4, 10, 13])],
    MANY,
    ['instances gaussians', 'shape gaussians'],
  ],
  ['no input with it', [tensor('time', [1])], [GAUSSIANS], MANY, ['instances instances']],
  [
    'an N that may change',
    [TIMES],
    [tensor('gaussians', ['B', 'N', 13])],
    MANY,
    ['instances gaussians', 'rows gaussians'],
  ],
  [
    'the axis twice',
    [TIMES],
    [tensor('gaussians', ['B', 'B', 13])],
    MANY,
    ['instances gaussians', 'instances gaussians', 'rows gaussians'],
  ],
  [
    'the axis behind',
    [tensor('time', [1, 'B'])],
    [GAUSSIANS],
    MANY,
    ['instances instances', 'instances time', 'shape time'],
  ],
  ['a shape that is wrong for one, too', [tensor('time', ['B', 3])], [GAUSSIANS], MANY, ['shape time']],
  ['the axis, undeclared', [TIMES], [GAUSSIANS], PACKED, ['shape gaussians', 'shape time']],
  [
    'a picture of each',
    [TIMES, tensor('image', ['B', 1, 3, 8, 8])],
    [GAUSSIANS],
    { ...MANY, inputs: { ...MANY.inputs, image: { role: 'image' } } },
    ['instances image'],
  ],
  [
    'a post-processor',
    [tensor('image', [1, 3, 8, 8])],
    [tensor('out', [1, 3, 8, 8])],
    {
      version: 1,
      inputs: { image: { role: 'image' } },
      outputs: { layout: 'image', image: 'out' },
      instances: { axis: 'B', most: 2 },
    },
    ['instances instances'],
  ],
];

for (const [what, inputs, outputs, contract, faults] of CASES) {
  test(`instances: ${what}`, () => {
    const found = checkContract(headerWith(inputs, outputs), contract);
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
