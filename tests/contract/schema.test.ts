/** The schema, its copy in JSON, the reader, the types and the published examples all say the same. */
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { Ajv2020 } from 'ajv/dist/2020.js';
import { CONTRACT_SCHEMA, ContractError, parseContract, type Contract } from '@gaussian-splat/core/contract';
import { seededRandom } from '../support/random.js';
import { fixturePath } from '../support/generators.js';
import { assertHelpful, PACKED, SPLIT } from './support.js';

const root = fileURLToPath(new URL('../../', import.meta.url));
const file = JSON.parse(readFileSync(`${root}packages/core/contract.schema.json`, 'utf8')) as object;
const ajv = new Ajv2020({ strict: true, strictRequired: false, allErrors: true });
const isValid = ajv.compile(file);

/** Every complete contract in docs/contract.md. */
function publishedExamples(): unknown[] {
  const text = readFileSync(`${root}docs/contract.md`, 'utf8');
  const blocks = [...text.matchAll(/```json\n([^]*?)```/g)].map(([, json]) => JSON.parse(json) as unknown);
  return blocks.filter((block) => 'version' in (block as object));
}

function sidecars(): unknown[] {
  const folder = fixturePath('');
  const names = readdirSync(folder).filter((name) => name.endsWith('.contract.json'));
  return names.map((name) => JSON.parse(readFileSync(folder + name, 'utf8')) as unknown);
}

/** True if the reader finds nothing against the schema; facts that contradict each other are beyond it. */
function readerAccepts(value: unknown): boolean {
  try {
    parseContract(value);
    return true;
  } catch (error) {
    assert.ok(error instanceof ContractError, String(error));
    assertHelpful(error.faults);
    return error.faults.every(({ code }) => code === 'contract/conflict');
  }
}

test('contract.schema.json is the schema of the code', () => {
  const message = 'run: npm run build && node scripts/write-contract-schema.mjs';
  assert.deepEqual(file, JSON.parse(JSON.stringify(CONTRACT_SCHEMA)), message);
});

test('published examples and fixtures are contracts, for us and for ajv', () => {
  const examples = publishedExamples();
  assert.ok(examples.length >= 5, `${examples.length} examples`);
  for (const value of [...examples, ...sidecars(), PACKED, SPLIT]) {
    assert.ok(isValid(value), `${JSON.stringify(value)}: ${ajv.errorsText(isValid.errors)}`);
    parseContract(value);
  }
});

test('docs/contract.md names every code that there is, and every field of the schema', () => {
  const errors = readFileSync(`${root}packages/core/src/errors.ts`, 'utf8');
  const guide = readFileSync(`${root}docs/contract.md`, 'utf8');
  const codesOf = (text: string): string[] => [
    ...new Set([...text.matchAll(/contract\/[a-z-]+(?=['`])/g)].map(String)),
  ];
  assert.deepEqual(codesOf(guide).sort(), codesOf(errors).sort());
  for (const field of Object.keys(CONTRACT_SCHEMA.properties!).filter((name) => name !== '$schema')) {
    assert.match(guide, new RegExp(`[\`"]${field}[\`"]`), field);
  }
});

/** One of each role and layout: the compiler holds it against the types, ajv against the schema. */
const EVERYTHING: readonly Contract[] = [
  {
    $schema: 'contract.schema.json',
    version: 1,
    name: 'x',
    inputs: {
      a: { role: 'view', order: 'column-major', axes: 'LUF' },
      b1: { role: 'camera_to_world', order: 'row-major', axes: 'RUB' },
      b2: { role: 'intrinsics', unit: 'normalized' },
      b: { role: 'projection', order: 'row-major', axes: 'RUB' },
      c: { role: 'view_projection', order: 'row-major' },
      d: { role: 'camera_position' },
      e: { role: 'viewport' },
      f: { role: 'time', unit: 'normalized' },
      g: { role: 'frame' },
      h: { role: 'seed' },
      i: {
        role: 'pose',
        format: 'quaternion',
        quaternionOrder: 'xyzw',
        joints: ['a'],
        parents: [-1],
        default: [0, 0, 0, 1],
      },
      j: { role: 'shape', names: ['wide'], default: [0] },
      k: { role: 'control', range: [0, 1], default: [0, 1], step: 0.1, label: 'K' },
      l: { role: 'gaussians', attribute: 'packed', color: 'sh', shOrder: 'channel-major', opacityActivation: 'logit' },
      n: { role: 'state', output: 'next', default: 0.5 },
      m: { role: 'image' },
      depth: { role: 'depth' },
    },
    outputs: { layout: 'visionary', gaussians: 'g', sh: 'c', count: 'n' },
    nMax: 10,
    dtype: 'float16',
    shDegree: 3,
    bounds: { min: [0, 0, 0], max: [1, 1, 1] },
    duration: 2,
    fps: 30,
    coordinates: { up: '+y', handedness: 'left', metresPerUnit: 2 },
    antialiased: true,
    filter: 'mip',
    license: 'MIT',
    attribution: 'somebody',
  },
  { version: 1, inputs: {}, outputs: { layout: 'image', image: 'out' } },
  SPLIT,
  PACKED,
];

test('every role and layout of the types is in the schema, and the other way round', () => {
  for (const contract of EVERYTHING) assert.ok(isValid(contract), ajv.errorsText(isValid.errors));
  const { inputs, outputs } = CONTRACT_SCHEMA.properties!;
  const named = (key: string, of: typeof inputs): unknown[] =>
    of.oneOf!.map(({ properties }) => properties![key].const);
  const roles = named('role', inputs.additionalProperties as typeof inputs);
  assert.deepEqual(
    roles,
    Object.values(EVERYTHING[0].inputs).map(({ role }) => role),
  );
  assert.deepEqual(named('layout', outputs).sort(), EVERYTHING.map(({ outputs: { layout } }) => layout).sort());
});

test('5,000 mutated contracts: the reader and ajv agree on every one', () => {
  const { uniform } = seededRandom(5);
  const pick = <T>(values: readonly T[]): T => values[Math.floor(uniform(0, values.length))];
  const seeds = [...EVERYTHING, ...publishedExamples(), ...sidecars()];
  let accepted = 0;
  for (let i = 0; i < 5_000; i++) {
    const value = structuredClone(pick(seeds)) as Record<string, unknown>;
    for (let n = 0; n < 1 + Math.floor(uniform(0, 3)); n++) mutate(value, pick);
    const ours = readerAccepts(value);
    // Contracts of other versions are refused before any other check, by the schema, too.
    assert.equal(ours, isValid(value), `${JSON.stringify(value)}: ${ajv.errorsText(isValid.errors)}`);
    if (ours) accepted++;
  }
  assert.ok(accepted > 200 && accepted < 4_500, `${accepted} accepted`);
});

const WORDS = [
  'linear',
  'logit',
  'log',
  'rgb',
  'sh',
  'view',
  'pose',
  'packed',
  'split',
  'row-major',
  'wxyz',
  'RUB',
  '',
  '-y',
];

function mutate(value: Record<string, unknown>, pick: <T>(values: readonly T[]) => T): void {
  const owners: Record<string, unknown>[] = [];
  const collect = (node: unknown): void => {
    if (typeof node !== 'object' || node === null) return;
    owners.push(node as Record<string, unknown>);
    Object.values(node).forEach(collect);
  };
  collect(value);
  const owner = pick(owners);
  const keys = Object.keys(owner);
  const key = pick([...keys, ...keys, 'extra', 'shOrder', 'count', 'colors', 'scales']);
  if (pick([true, false, false])) {
    if (Array.isArray(owner)) owner.pop();
    else delete owner[key];
    return;
  }
  owner[Array.isArray(owner) && !keys.includes(key) ? owner.length : key] = pick<unknown>([
    ...WORDS,
    ...[0, 1, -1, 1.5, 1e9, true, null, {}, [], [0, 1], [1, 2, 3]],
  ]);
}
