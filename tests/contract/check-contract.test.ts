import assert from 'node:assert/strict';
import { test } from 'node:test';
import { checkContract, resolveContract, type Contract, type PackedOutputs } from '@gaussian-splat/core/contract';
import type { OnnxHeader, OnnxTensor } from '@gaussian-splat/core/onnx';
import { fixtureHeader, fixtureNames, fixtureSidecar } from '../support/generators.js';
import { assertHelpful, brief, headerWith, PACKED, SPLIT, SPLIT_OUTPUTS, tensor } from './support.js';

for (const name of fixtureNames().filter((file) => !['subgraphs.onnx', 'faulty-cast.onnx'].includes(file))) {
  test(`${name} keeps its contract as far as the header shows`, async () => {
    const header = await fixtureHeader(name);
    const { contract } = resolveContract({ header, sidecar: fixtureSidecar(name) });
    assert.deepEqual(checkContract(header, contract), []);
  });
}

const TIME = tensor('time', [1]);
const GAUSSIANS = tensor('gaussians', [10, 13]);
const withSplit = (...changed: OnnxTensor[]): OnnxHeader =>
  headerWith(
    [],
    SPLIT_OUTPUTS.map((output) => changed.find(({ name }) => name === output.name) ?? output),
  );
const withInput = (binding: Contract['inputs'][string]): Contract => ({ ...PACKED, inputs: { x: binding } });
const fed = (dims: OnnxTensor['dims'], dtype?: OnnxTensor['dtype']): OnnxHeader =>
  headerWith([tensor('x', dims, dtype)], [GAUSSIANS]);
const LGM: Contract = {
  ...PACKED,
  outputs: {
    ...(PACKED.outputs as PackedOutputs),
    columns: ['positions', 'opacities', 'scales', 'rotations', 'colors'],
    scaleActivation: 'linear',
    rotationOrder: 'wxyz',
  },
};
const ready = headerWith([TIME], [GAUSSIANS]);
const symbolic = headerWith([TIME], [tensor('gaussians', ['n', 13])]);
const external = [{ location: 'w.bin', byteLength: 100 }];

const CASES: readonly [what: string, header: OnnxHeader, contract: Contract, faults: readonly string[]][] = [
  ['nothing wrong', ready, PACKED, []],
  ['a scalar time', headerWith([tensor('time', [])], [GAUSSIANS]), PACKED, []],
  ['an input without a role', headerWith([TIME, tensor('extra', [2])], [GAUSSIANS]), PACKED, ['unbound-input extra']],
  ['an input that the file lacks', headerWith([], [GAUSSIANS]), PACKED, ['missing-tensor time']],
  [
    'an output that the file lacks',
    headerWith([TIME], [tensor('other', [10, 13])]),
    PACKED,
    ['missing-tensor gaussians'],
  ],
  ['unused outputs', headerWith([TIME], [GAUSSIANS, tensor('more', [1])]), PACKED, []],
  ['a wrong width', headerWith([TIME], [tensor('gaussians', [10, 14])]), PACKED, ['shape gaussians']],
  ['a batch of one', headerWith([tensor('time', [1, 1])], [tensor('gaussians', [1, 10, 13])]), PACKED, []],
  ['a batch of two', headerWith([TIME], [tensor('gaussians', [2, 10, 13])]), PACKED, ['shape gaussians']],
  ['a row of LGM', headerWith([TIME], [tensor('gaussians', [1, 10, 14])]), LGM, []],
  ['a row too short for its columns', headerWith([TIME], [tensor('gaussians', [10, 13])]), LGM, ['shape gaussians']],
  ['no shape at all', headerWith([TIME], [tensor('gaussians', undefined)]), PACKED, ['shape gaussians']],
  ['a symbolic width', headerWith([TIME], [tensor('gaussians', [10, 'd'])]), PACKED, ['shape gaussians']],
  ['a wrong type', headerWith([TIME], [tensor('gaussians', [10, 13], 'float64')]), PACKED, ['dtype gaussians']],
  [
    'shape and type',
    headerWith([TIME], [tensor('gaussians', [10], 'int8')]),
    PACKED,
    ['dtype gaussians', 'shape gaussians'],
  ],
  ['symbolic N without nMax', symbolic, PACKED, ['rows gaussians']],
  ['symbolic N with nMax', symbolic, { ...PACKED, nMax: 10 }, []],
  ['N above nMax', ready, { ...PACKED, nMax: 9 }, ['rows gaussians']],
  [
    'N above nMax, padded behind a count',
    headerWith([TIME], [GAUSSIANS, tensor('n', [1], 'int64')]),
    { ...PACKED, nMax: 9, outputs: { ...(PACKED.outputs as PackedOutputs), count: 'n' } },
    [],
  ],
  ['another type than declared', ready, { ...PACKED, dtype: 'float16' }, ['dtype gaussians']],
  ['harmonics declared, colors written', ready, { ...PACKED, shDegree: 2 }, ['sh-degree gaussians']],
  ['degree 0 declared, colors written', ready, { ...PACKED, shDegree: 0 }, []],
  ['split', withSplit(), SPLIT, []],
  ['split, opacities of rank 1', withSplit(tensor('o', [10])), SPLIT, []],
  ['split, other N', withSplit(tensor('s', [11, 3]), tensor('h', [12, 4, 3])), SPLIT, ['rows h', 'rows s']],
  ['split, other types', withSplit(tensor('o', [10, 1], 'float16')), SPLIT, ['dtype o']],
  ['split, harmonics of no degree', withSplit(tensor('h', [10, 5, 3])), SPLIT, ['shape h']],
  ['split, harmonics the other way', withSplit(tensor('h', [10, 3, 9])), SPLIT, ['shape h']],
  ['split, another degree', withSplit(), { ...SPLIT, shDegree: 3 }, ['sh-degree h']],
  ['split, a count of int64', withSplit(tensor('c', [1], 'int64')), SPLIT, []],
  ['split, one scale a splat', withSplit(tensor('s', [10, 1])), SPLIT, []],
  ['split, in a batch', withSplit(tensor('p', [1, 10, 3]), tensor('o', [1, 10])), SPLIT, []],
  ['split, flat harmonics', withSplit(tensor('h', [10, 27])), SPLIT, []],
  ['view', fed([4, 4]), withInput({ role: 'view' }), []],
  ['view in a batch', fed([1, 4, 4]), withInput({ role: 'view' }), []],
  ['views of two cameras', fed([2, 4, 4]), withInput({ role: 'view' }), ['shape x']],
  ['camera to world', fed([1, 4, 4]), withInput({ role: 'camera_to_world', axes: 'RUB' }), []],
  ['intrinsics', fed([1, 3, 3]), withInput({ role: 'intrinsics', unit: 'normalized' }), []],
  ['intrinsics of another size', fed([4, 4]), withInput({ role: 'intrinsics', unit: 'pixels' }), ['shape x']],
  ['flat axis-angles', fed([1, 72]), withInput({ role: 'pose', format: 'axis-angle' }), []],
  ['rotation matrices', fed([1, 24, 3, 3]), withInput({ role: 'pose', format: 'matrix' }), []],
  ['flat matrices of no number of joints', fed([10]), withInput({ role: 'pose', format: 'matrix' }), ['shape x']],
  ['images of two views', fed([1, 2, 3, 8, 8]), withInput({ role: 'image' }), []],
  ['an image with alpha', fed([1, 4, 8, 8]), withInput({ role: 'image' }), []],
  [
    'a state',
    headerWith([tensor('x', [5, 3])], [GAUSSIANS, tensor('next', [5, 3])]),
    withInput({ role: 'state', output: 'next' }),
    [],
  ],
  [
    'a state of another shape',
    headerWith([tensor('x', [5, 3])], [GAUSSIANS, tensor('next', [5, 4])]),
    withInput({ role: 'state', output: 'next' }),
    ['shape next'],
  ],
  ['a state that no output writes', fed([5, 3]), withInput({ role: 'state', output: 'n' }), ['missing-tensor n']],
  ['view in float16', fed([4, 4], 'float16'), withInput({ role: 'view' }), ['dtype x']],
  ['frame in float', fed([1]), withInput({ role: 'frame' }), ['dtype x']],
  ['frame in int64', fed([1], 'int64'), withInput({ role: 'frame' }), []],
  [
    'quaternions of 3',
    fed([24, 3]),
    withInput({ role: 'pose', format: 'quaternion', quaternionOrder: 'wxyz' }),
    ['shape x'],
  ],
  ['a symbolic pose', fed(['j', 3]), withInput({ role: 'pose', format: 'axis-angle' }), ['shape x']],
  [
    'joints of another number',
    fed([3, 3]),
    withInput({ role: 'pose', format: 'axis-angle', joints: ['a'] }),
    ['shape x'],
  ],
  ['a shape with other names', fed([2]), withInput({ role: 'shape', names: ['a'] }), ['shape x']],
  ['a control', fed([2, 3], 'int32'), withInput({ role: 'control', range: [0, 9], default: 3 }), []],
  ['a control with other defaults', fed([2]), withInput({ role: 'control', range: [0, 9], default: [3] }), ['shape x']],
  [
    'a control of whole numbers with others',
    fed([2], 'int64'),
    withInput({ role: 'control', range: [0.2, 0.8], default: [0.5, 0.2] }),
    ['conflict x', 'conflict x'],
  ],
  [
    'a control of more than int32',
    fed([1], 'int32'),
    withInput({ role: 'control', range: [0, 2 ** 31], default: 1 }),
    ['conflict x'],
  ],
  [
    'a control of int64 of more than int32',
    fed([1], 'int64'),
    withInput({ role: 'control', range: [-1, 2 ** 31], default: 1 }),
    [],
  ],
  ['a symbolic control', fed(['k']), withInput({ role: 'control', range: [0, 9], default: 3 }), ['shape x']],
  ['a control of text', fed([1], 'string'), withInput({ role: 'control', range: [0, 9], default: 3 }), ['dtype x']],
  ['an image of open size', fed([1, 3, 'h', 'w']), withInput({ role: 'image' }), []],
  ['a gray image', fed([1, 1, 8, 8]), withInput({ role: 'image' }), ['shape x']],
  ['a newer opset', { ...ready, opsets: new Map([['ai.onnx', 27]]) }, PACKED, ['opset opset of ai.onnx']],
  ['an old opset', { ...ready, opsets: new Map([['ai.onnx', 6]]) }, PACKED, ['opset opset of ai.onnx']],
  ['no opset', { ...ready, opsets: new Map(), operators: new Map([['Add', 1]]) }, PACKED, ['opset opset of ai.onnx']],
  ['a newer IR version', { ...ready, irVersion: 14 }, PACKED, ['opset IR version']],
  [
    'a foreign operator',
    { ...ready, operators: new Map([['com.nobody:Foo', 1]]) },
    PACKED,
    ['operator operator com.nobody:Foo'],
  ],
  ...[17, 18].map((opset): [string, OnnxHeader, Contract, string[]] => [
    `a reduction of opset 18 in a file of opset ${opset}`,
    {
      ...ready,
      opsets: new Map([['ai.onnx', opset]]),
      nodes: [
        {
          name: '',
          operator: 'ReduceL2',
          inputs: ['x'],
          outputs: ['y'],
          isInner: false,
          numbers: { noop_with_empty_axes: 0 },
        },
      ],
    },
    PACKED,
    opset === 17 ? ['operator operator ReduceL2 (y)'] : [],
  ]),
  [
    'operators of the file and of the runtime',
    {
      ...ready,
      operators: new Map([
        ['my:Foo', 1],
        ['com.microsoft:Gelu', 2],
      ]),
      functions: new Set(['my:Foo']),
    },
    PACKED,
    [],
  ],
];

test('an input with a default in the file has no role: why is said', () => {
  const header = { ...headerWith([], [GAUSSIANS]), optionalInputs: ['time'] };
  const faults = checkContract(header, PACKED);
  assertHelpful(faults);
  assert.deepEqual(brief(faults), ['missing-tensor time']);
  assert.match(faults[0].found, /initializer/);
});

for (const [what, header, contract, expected] of CASES) {
  test(`checkContract: ${what}`, () => {
    const faults = checkContract(header, contract);
    assertHelpful(faults);
    assert.deepEqual(brief(faults), expected);
  });
}

test('a symbolic width is to be a number, a wrong one is to be another', () => {
  const remedyOf = (width: number | string): string =>
    checkContract(headerWith([TIME], [tensor('gaussians', [10, width])]), PACKED)[0].remedy;
  assert.match(remedyOf('d'), /fixed sizes must be numbers/);
  assert.match(remedyOf(14), /rows of this width/);
});

test('external data: there, missing, short, unknown, outside', () => {
  const header = { ...ready, externalFiles: external };
  const codes = (files?: ReadonlyMap<string, number>): string[] => brief(checkContract(header, PACKED, { files }));
  assert.deepEqual(codes(), []);
  assert.deepEqual(codes(new Map([['w.bin', 100]])), []);
  assert.match(codes(new Map()).join(), /^external-data/);
  assert.match(codes(new Map([['w.bin', 99]])).join(), /^external-data/);
  for (const location of [
    '../w.bin',
    '/etc/passwd',
    'C:\\w.bin',
    'a/../../w.bin',
    'https://x.org/w',
    '\\\\server\\w',
    '',
  ]) {
    const outside = { ...ready, externalFiles: [{ location, byteLength: 0 }] };
    assert.match(brief(checkContract(outside, PACKED)).join(), /^external-data/, location);
  }
});

test('faults of all kinds are collected at once', () => {
  const header = headerWith([tensor('a', [1])], [tensor('gaussians', ['n', 14], 'float64')], {
    irVersion: 99,
    opsets: new Map([['ai.onnx', 99]]),
    operators: new Map([['x:Y', 1]]),
    externalFiles: [{ location: '../w', byteLength: 0 }],
  });
  const faults = checkContract(header, PACKED);
  assertHelpful(faults);
  assert.deepEqual(
    brief(faults).map((line) => line.split(' ')[0]),
    ['dtype', 'external-data', 'missing-tensor', 'operator', 'opset', 'opset', 'shape', 'unbound-input'],
  );
});
