import assert from 'node:assert/strict';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { ContractError, parseContract } from '@gaussian-splat/core/contract';
import { brief, faultsOf, PACKED, SPLIT } from './support.js';

const withOutputs = (outputs: object): unknown => ({ ...PACKED, outputs: { ...PACKED.outputs, ...outputs } });
const withInput = (input: object): unknown => ({ ...PACKED, inputs: { x: input } });

test('text and values are read alike, a byte-order mark included', () => {
  assert.deepEqual(parseContract(JSON.stringify(PACKED)), PACKED);
  assert.deepEqual(parseContract(`\ufeff${JSON.stringify(PACKED)}`), PACKED);
  assert.equal(parseContract(PACKED), PACKED);
});

const REFUSALS: readonly [what: string, json: unknown, code: string, where: RegExp, message: RegExp][] = [
  ['no JSON', '{"version": 1,', 'contract/json', /^c$/, /correct the JSON/i],
  ['a web page', '<!doctype html>', 'contract/json', /^c$/, /web page/],
  ['a list', [], 'contract/schema', /^c$/, /an object in braces/],
  ['null', 'null', 'contract/schema', /^c$/, /found null/],
  ['a later version', { version: 2 }, 'contract/version', /c\.version/, /update this library/i],
  ['an earlier version', { version: 0.5 }, 'contract/version', /c\.version/, /version 1/],
  [
    'an unknown role',
    withInput({ role: 'veiw' }),
    'contract/schema',
    /c\.inputs\.x\.role/,
    /one of view, .*found "veiw"/,
  ],
  ['no role', withInput({}), 'contract/schema', /c\.inputs\.x\.role/, /found nothing/],
  [
    'no activation',
    withOutputs({ opacityActivation: undefined }),
    'contract/schema',
    /opacityActivation/,
    /linear, logit/,
  ],
  [
    'a wrong activation',
    withOutputs({ opacityActivation: 'sigmoid' }),
    'contract/schema',
    /opacityActivation/,
    /"sigmoid"/,
  ],
  [
    'another spelling',
    withOutputs({ opacity_activation: 'linear' }),
    'contract/schema',
    /opacity_activation/,
    /unknown field/,
  ],
  ['harmonics without order', withOutputs({ color: 'sh' }), 'contract/schema', /shOrder/, /coefficient-major/],
  ['half of each', withOutputs({ positions: 'p' }), 'contract/schema', /outputs\.positions/, /unknown field/],
  ['a negative nMax', { ...PACKED, nMax: 0 }, 'contract/schema', /nMax/, /1 or more/],
  ['control without range', withInput({ role: 'control', default: 1 }), 'contract/schema', /x\.range/, /a list/],
  [
    'control out of range',
    withInput({ role: 'control', range: [0, 1], default: 2 }),
    'contract/conflict',
    /x\.default/,
    /0\.\.1/,
  ],
  [
    'an upside-down range',
    withInput({ role: 'control', range: [1, 0], default: 0 }),
    'contract/conflict',
    /x\.range/,
    /exchange/i,
  ],
  ['normalized time', withInput({ role: 'time', unit: 'normalized' }), 'contract/conflict', /x\.unit/, /duration/],
  ['quaternions', withInput({ role: 'pose', format: 'quaternion' }), 'contract/schema', /quaternionOrder/, /wxyz/],
  [
    'children before parents',
    withInput({ role: 'pose', format: 'axis-angle', parents: [-1, 1] }),
    'contract/conflict',
    /parents/,
    /parent 1 of joint 1/,
  ],
  [
    'inputs named twice',
    { ...PACKED, inputs: { a: { role: 'seed' }, b: { role: 'seed' } } },
    'contract/conflict',
    /inputs\.b/,
    /a and b/,
  ],
  ['one tensor twice', withOutputs({ count: 'gaussians' }), 'contract/conflict', /count/, /a separate output/],
  [
    'bounds upside down',
    { ...PACKED, bounds: { min: [0, 2, 0], max: [1, 1, 1] } },
    'contract/conflict',
    /bounds/,
    /axis y/,
  ],
];

for (const [what, json, code, where, message] of REFUSALS) {
  test(`refused: ${what}`, () => {
    // Fields that are undefined are not there, as in JSON.
    const value = typeof json === 'string' ? json : (JSON.parse(JSON.stringify(json)) as unknown);
    const faults = faultsOf(() => parseContract(value, 'c'));
    assert.equal(faults[0].code, code);
    assert.match(faults[0].where, where);
    assert.match(new ContractError(faults).message, message);
  });
}

test('split: either covariances or scales with rotations, either colors or harmonics', () => {
  const rest: Record<string, unknown> = { ...SPLIT.outputs };
  delete rest.scales;
  assert.match(String(faultsOf(() => parseContract({ ...SPLIT, outputs: rest }))[0].found), /nothing/);
  const both = { ...SPLIT.outputs, covariances: 'q', colors: 'k' };
  assert.deepEqual(
    faultsOf(() => parseContract({ ...SPLIT, outputs: both })).map(({ expected, found }) => `${expected}: ${found}`),
    ['either covariances or scales: both', 'either colors or sh: both'],
  );
});

test('hostile contracts give short messages', () => {
  const many = Object.fromEntries(Array.from({ length: 50_000 }, (_, i) => [`${'x'.repeat(i % 200)}${i}`, 0]));
  const faults = faultsOf(() => parseContract({ ...PACKED, ...many, inputs: { ['y'.repeat(1e6)]: { role: 'z' } } }));
  assert.equal(faults.length, 50_001);
  const { message } = new ContractError(faults);
  assert.ok(message.length < 20_000 && message.endsWith('- and 49981 more'), `${message.length}`);
});

test('lists within lists, where a contract has something else, are faults with a name', () => {
  const deep: unknown = JSON.parse('['.repeat(100_000) + ']'.repeat(100_000));
  for (const contract of [deep, { version: deep }, { ...PACKED, inputs: deep }])
    assert.throws(() => parseContract(contract), ContractError);
});

test('there may be several matrices, controls and images', () => {
  const control = { role: 'control', range: [0, 1], default: 0 };
  const matrices = { a: { role: 'view' }, b: { role: 'view', axes: 'RUB' } };
  const inputs = { ...matrices, c: control, d: control, e: { role: 'image' }, f: { role: 'image' } };
  parseContract({ ...PACKED, inputs });
});

test('all faults are reported, and survive postMessage', () => {
  const bad = {
    version: 1,
    inputs: { a: { role: 'time' }, b: 3 },
    outputs: { layout: 'packed' },
    fps: 'fast',
    extra: 1,
  };
  const faults = faultsOf(() => parseContract(bad));
  assert.deepEqual(
    brief(faults),
    [
      ...['contract.extra', 'contract.fps', 'contract.inputs.a.unit', 'contract.inputs.b'],
      ...['contract.outputs.color', 'contract.outputs.gaussians', 'contract.outputs.opacityActivation'],
    ].map((where) => `schema ${where}`),
  );
  const error = new ContractError(faults);
  assert.ok(error instanceof GaussianSplatError);
  assert.equal(error.family, 'contract');
  assert.match(error.message, /^7 faults:\n- /);
  const copy = ContractError.fromData(structuredClone(error.toData()));
  assert.deepEqual([copy.faults, copy.message, copy.code], [error.faults, error.message, error.code]);
});

test('a contract of very many faults reports the first ones', () => {
  const extra = Object.fromEntries(Array.from({ length: 200_000 }, (_, k) => [`x${k}`, 0]));
  const faults = faultsOf(() => parseContract({ ...PACKED, outputs: { ...PACKED.outputs, ...extra } }));
  assert.equal(faults.length, 60_000);
});
