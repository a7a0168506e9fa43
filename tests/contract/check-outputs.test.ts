import assert from 'node:assert/strict';
import { test } from 'node:test';
import { halfToNumber, numberToHalf } from '@gaussian-splat/core';
import {
  checkBounds,
  checkOutputs,
  compareRuns,
  type Contract,
  type ContractFault,
  type OutputTensor,
} from '@gaussian-splat/core/contract';
import { seededRandom } from '../support/random.js';
import { assertHelpful, PACKED, SPLIT } from './support.js';

const ROW = [1, 2, 3, 0.04, 0, 0, 0.05, 0, 0.06, 0.5, 0.5, 0.5, 1];

/** Packed rows with single numbers changed: `changes` maps row and column to a value. */
function packed(rows: number, changes: readonly [row: number, column: number, value: number][] = []): OutputTensor {
  const data = Float32Array.from({ length: 13 * rows }, (_, i) => ROW[i % 13]);
  for (const [row, column, value] of changes) data[13 * row + column] = value;
  return { dtype: 'float32', dims: [rows, 13], data };
}

const asHalf = ({ dims, data }: OutputTensor): OutputTensor => ({
  dtype: 'float16',
  dims,
  data: Uint16Array.from(data, numberToHalf),
});

const check = (gaussians: OutputTensor, contract: Contract = PACKED): readonly ContractFault[] => {
  const { faults } = checkOutputs(contract, { gaussians });
  assertHelpful(faults);
  return faults;
};
const codes = (faults: readonly ContractFault[]): string[] => faults.map(({ code }) => code.slice(9));

test('good rows: counted, with their box', () => {
  const report = checkOutputs(PACKED, { gaussians: packed(5, [[2, 0, -4]]) });
  assert.deepEqual(report, { faults: [], rows: 5, live: 5, bounds: { min: [-4, 2, 3], max: [1, 2, 3] } });
  assert.deepEqual(checkOutputs(PACKED, { gaussians: asHalf(packed(5)) }).faults, []);
});

test('no Gaussian at all is an answer', () => {
  const report = checkOutputs(PACKED, { gaussians: { dtype: 'float32', dims: [0, 13], data: new Float32Array(0) } });
  assert.deepEqual(report, { faults: [], rows: 0, live: 0, bounds: undefined });
});

test('one fault for each kind, with the first row and the number of rows', () => {
  const faults = check(
    packed(9, [
      [1, 0, NaN],
      [4, 2, Infinity],
      [2, 12, 1.5],
      [3, 3, -1],
      [5, 9, NaN],
    ]),
  );
  assert.deepEqual(codes(faults), ['not-finite', 'covariance', 'not-finite', 'opacity']);
  assert.match(faults[0].where, /positions of row 1/);
  assert.match(faults[0].found, /^NaN; in 2 of 9 rows$/);
  assert.match(faults[2].where, /colors of row 5/);
  assert.equal(faults[3].tensor, 'gaussians');
});

test('opacities: 0 and 1 are in range, in float16 as well; others are not', () => {
  for (const value of [0, 1, 1e-7, -0]) assert.deepEqual(check(packed(1, [[0, 12, value]])), [], String(value));
  for (const value of [-0.01, 1.01, 7]) {
    assert.deepEqual(codes(check(packed(1, [[0, 12, value]]))), ['opacity']);
    assert.deepEqual(codes(check(asHalf(packed(1, [[0, 12, value]])))), ['opacity']);
  }
  const logits = { ...PACKED, outputs: { ...PACKED.outputs, opacityActivation: 'logit' } } as Contract;
  for (const value of [-9, 12, Infinity, -Infinity]) assert.deepEqual(check(packed(1, [[0, 12, value]]), logits), []);
  assert.deepEqual(codes(check(packed(1, [[0, 12, NaN]]), logits)), ['not-finite']);
});

/** Covariance R·S·Sᵀ·Rᵀ of random rotations and scales from 1e-4 to 10, in float64. */
function randomCovariance(random: ReturnType<typeof seededRandom>, flat: boolean): number[] {
  const [w, x, y, z] = random.rotation();
  const rotation = [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
  const scales = [0, 1, 2].map((axis) => (flat && axis === 0 ? 0 : random.logUniform(1e-4, 10)));
  const entry = (i: number, j: number): number =>
    scales.reduce((sum, scale, k) => sum + rotation[i][k] * rotation[j][k] * scale * scale, 0);
  return [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
}

test('20,000 true covariances, needles and discs among them, pass in float32 and float16', () => {
  const random = seededRandom(11);
  const rows = 20_000;
  const gaussians = packed(rows);
  const data = gaussians.data as Float32Array;
  for (let row = 0; row < rows; row++) data.set(randomCovariance(random, row % 3 === 0), 13 * row + 3);
  assert.deepEqual(check(gaussians), []);
  assert.deepEqual(check(asHalf(gaussians)), []);
});

test('covariances with one negative eigenvalue are found at any size', () => {
  const random = seededRandom(12);
  for (let i = 0; i < 500; i++) {
    const covariance = randomCovariance(random, true);
    const trace = covariance[0] + covariance[3] + covariance[5];
    // Less than nothing along all axes: the smallest eigenvalue, 0, becomes -1 % of the trace.
    const changed = covariance.map((value, k) => ([0, 3, 5].includes(k) ? value - 0.01 * trace : value));
    const changes = changed.map((value, k): [number, number, number] => [0, 3 + k, value]);
    assert.deepEqual(codes(check(packed(1, changes))), ['covariance'], changed.join());
    if (trace > 1e-2) assert.deepEqual(codes(check(asHalf(packed(1, changes)))), ['covariance'], changed.join());
  }
});

test('count: only living rows are checked, and it must fit', () => {
  const contract: Contract = { ...PACKED, outputs: { ...PACKED.outputs, count: 'n' } as Contract['outputs'] };
  const report = (count: number): ReturnType<typeof checkOutputs> =>
    checkOutputs(contract, {
      gaussians: packed(5, [[3, 0, NaN]]),
      n: { dtype: 'int32', dims: [1], data: Int32Array.of(count) },
    });
  assert.deepEqual([report(3).faults, report(3).live], [[], 3]);
  assert.deepEqual(codes(report(4).faults), ['not-finite']);
  assert.deepEqual(codes(report(6).faults), ['count', 'not-finite']);
  assert.deepEqual([codes(report(-1).faults), report(-1).live], [['count'], 0]);
  assert.deepEqual(codes(checkOutputs(contract, { gaussians: packed(1) }).faults), ['missing-tensor']);
});

function split(changes: Readonly<Record<string, Partial<OutputTensor>>> = {}): Record<string, OutputTensor> {
  const tensor = (dims: number[], value: number): OutputTensor => ({
    dtype: 'float32',
    dims,
    data: new Float32Array(dims.reduce((product, dim) => product * dim, 1)).fill(value),
  });
  const outputs: Record<string, OutputTensor> = {
    p: tensor([2, 3], 0),
    s: tensor([2, 3], -3),
    r: tensor([2, 4], 0.5),
    h: tensor([2, 4, 3], 0),
    o: tensor([2, 1], -20),
    c: { dtype: 'int32', dims: [1], data: Int32Array.of(2) },
  };
  for (const [name, change] of Object.entries(changes)) outputs[name] = { ...outputs[name], ...change };
  return outputs;
}

test('split: scales, rotations, logits', () => {
  const found = (changes: Parameters<typeof split>[0], contract: Contract = SPLIT): string[] => {
    const { faults } = checkOutputs(contract, split(changes));
    assertHelpful(faults);
    return codes(faults);
  };
  const linear = { ...SPLIT, outputs: { ...SPLIT.outputs, scaleActivation: 'linear' } } as Contract;
  assert.deepEqual(found({}), []);
  assert.deepEqual(found({}, linear), ['covariance'], 'negative standard deviations');
  assert.deepEqual(found({ s: { data: new Float32Array(6).fill(-Infinity) } }), [], 'the logarithm of 0');
  assert.deepEqual(found({ s: { data: new Float32Array(6).fill(Infinity) } }), ['not-finite']);
  assert.deepEqual(found({ r: { data: new Float32Array(8) } }), ['covariance'], 'zero quaternions');
  assert.deepEqual(found({ p: { dims: [3, 2] } }), ['shape']);
  assert.deepEqual(found({ p: { dims: [3, 3], data: new Float32Array(9) } }), ['rows', 'rows', 'rows', 'rows']);
  assert.deepEqual(found({}, { ...SPLIT, nMax: 1 }), ['count'], 'more rows live than nMax');
  assert.deepEqual(found({ p: { dims: [1, 2, 3] }, c: { dtype: 'int64', data: [2n] as never } }), [], 'the same bytes');
});

test('declared bounds hold the centers', () => {
  const bounded = (max: number): Contract => ({ ...PACKED, bounds: { min: [0, 0, 0], max: [max, max, max] } });
  const report = checkOutputs(PACKED, { gaussians: packed(2) });
  assert.deepEqual(checkBounds(PACKED, report), []);
  assert.deepEqual(checkBounds(bounded(3), report), []);
  const faults = checkBounds(bounded(2.5), report);
  assertHelpful(faults);
  assert.deepEqual(codes(faults), ['conflict']);
  assert.equal(faults[0].tensor, 'gaussians');
});

test('declared bounds of one Gaussian are its center, rounded', () => {
  const bounds = { min: [0.1, 200.2, -0.3], max: [0.1, 200.2, -0.3] } as const;
  const one = packed(1, [
    [0, 0, 0.1],
    [0, 1, 200.2],
    [0, 2, -0.3],
  ]);
  assert.deepEqual(checkBounds({ ...PACKED, bounds }, checkOutputs(PACKED, { gaussians: one })), []);
  const half: Contract = { ...PACKED, bounds, dtype: 'float16' };
  assert.deepEqual(checkBounds(half, checkOutputs(half, { gaussians: asHalf(one) })), []);
  const moved = packed(1, [
    [0, 0, 0.101],
    [0, 1, 200.2],
    [0, 2, -0.3],
  ]);
  assert.deepEqual(codes(checkBounds({ ...PACKED, bounds }, checkOutputs(PACKED, { gaussians: moved }))), ['conflict']);
});

test('images are finite', () => {
  const contract: Contract = { version: 1, inputs: {}, outputs: { layout: 'image', image: 'out' } };
  const out = (value: number): OutputTensor => ({
    dtype: 'float32',
    dims: [1, 3, 2, 2],
    data: new Float32Array(12).fill(value),
  });
  assert.deepEqual(checkOutputs(contract, { out: out(0.5) }).faults, []);
  assert.deepEqual(codes(checkOutputs(contract, { out: out(NaN) }).faults), ['not-finite']);
});

test('two runs: the same bits, or a seed', () => {
  const compare = (a: OutputTensor, b: OutputTensor, contract = PACKED): string[] =>
    codes(compareRuns(contract, { gaussians: a }, { gaussians: b }));
  assert.deepEqual(compare(packed(3), packed(3)), []);
  assert.deepEqual(compare(packed(3, [[0, 0, NaN]]), packed(3, [[0, 0, NaN]])), [], 'NaN is the same NaN');
  assert.deepEqual(compare(packed(3), packed(3, [[2, 1, 2.0001]])), ['not-deterministic']);
  assert.deepEqual(compare(packed(3), packed(4)), ['not-deterministic']);
  const seeded: Contract = { ...PACKED, inputs: { s: { role: 'seed' } } };
  assert.deepEqual(compare(packed(3), packed(4), seeded), []);
});

test('float16: all 65,536 patterns there and back', () => {
  for (let bits = 0; bits < 65_536; bits++) {
    const value = halfToNumber(bits);
    if (Number.isNaN(value)) assert.ok(Number.isNaN(halfToNumber(numberToHalf(value))));
    else if (numberToHalf(value) !== bits && value !== 0) assert.fail(`${bits} became ${numberToHalf(value)}`);
  }
  assert.deepEqual([1, 65504, 2 ** -24, 1 / 3, 0.1].map(numberToHalf), [0x3c00, 0x7bff, 1, 0x3555, 0x2e66]);
});
