/** The checker as a command and as a function, on the fixtures and on real files. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { copyFileSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { tmpdir } from 'node:os';
import { basename, join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { checkModel, formatReport, type CheckReport } from '@gaussian-splat/check';
import { ContractError } from '@gaussian-splat/core/contract';
import { needsSharedData, sharedPath } from '../support/data.js';
import { fixtureBytes, fixtureNames, fixturePath } from '../support/generators.js';

const root = fileURLToPath(new URL('../../', import.meta.url));
/** One small file of every family. */
const families = join(root, 'tests/fixtures/families');
const folder = mkdtempSync(join(tmpdir(), 'check-'));
after(() => rmSync(folder, { recursive: true }));

const codes = ({ faults }: CheckReport): string[] => faults.map(({ code }) => code).sort();

function command(...args: string[]): { status: number | null; text: string } {
  const bin = `${root}packages/check/bin/gaussian-check.js`;
  const { status, stdout, stderr } = spawnSync(process.execPath, [bin, ...args], { encoding: 'utf8' });
  return { status, text: stdout + stderr };
}

/** Faults of each fixture, values included. */
const FAULTS: Readonly<Record<string, readonly string[]>> = {
  'faulty-values.onnx': [
    'contract/count',
    'contract/covariance',
    'contract/not-finite',
    'contract/not-finite',
    'contract/opacity',
  ],
  'faulty-random.onnx': ['contract/not-deterministic'],
  // At both ends of its time and in the middle it is fine.
  'faulty-quarter.onnx': ['contract/not-finite', 'contract/not-finite', 'contract/not-finite', 'contract/not-finite'],
  'faulty-cast.onnx': ['contract/operator'],
  'faulty-instances.onnx': ['contract/instances'],
  'faulty-rows.onnx': ['contract/rows'],
  'faulty-run.onnx': ['contract/run'],
  // From its first second on, which the sample of the last time reaches.
  'faulty-later.onnx': ['contract/run'],
  'post-nan.onnx': ['contract/not-finite'],
  'subgraphs.onnx': [
    'contract/inference',
    'contract/inference',
    'contract/inference',
    'contract/inference',
    // A domain that is not part of ONNX, and a tensor of bfloat16.
    'contract/operator',
    'contract/operator',
  ],
};

/** On the CPU what does not end cannot be given up. */
const ENDLESS = ['endless.onnx'];

for (const name of fixtureNames().filter((name) => !ENDLESS.includes(name))) {
  test(`${name}, run on the CPU`, async () => {
    const report = await checkModel(fixturePath(name), { run: true });
    assert.deepEqual(codes(report), FAULTS[name] ?? []);
    const runs = report.sections.find(({ title }) => title === 'Runs');
    const isRun = !codes(report).some((code) => /run|inference|operator/.test(code));
    const hasControls = /^(packed-sh-half|post(?!-temporal|-seen|-reached).*|link-.*|state)\.onnx$/.test(name);
    // Models that know the time also get six fractions of it.
    const rows = runs?.rows.filter(([label]) => !label.endsWith(' of the time'));
    assert.equal(rows?.length, isRun ? (hasControls ? 5 : 3) : undefined);
  });
}

for (const name of readdirSync(families)) {
  test(`${name} of the exporter keeps its contract, run on the CPU`, async () => {
    assert.deepEqual(codes(await checkModel(join(families, name), { run: true })), []);
  });
}

test('values that were run are the ones in the table: the count of rows follows its control', async () => {
  const { sections } = await checkModel(fixturePath('packed-sh-half.onnx'), { run: true });
  const live = sections.find(({ title }) => title === 'Runs')!.rows.map(([, rows]) => rows);
  assert.deepEqual(live, ['32 of 64 rows', '32 of 64 rows', '32 of 64 rows', '0 of 64 rows', '64 rows']);
});

test('the command: a table and 0, faults and 1, wrong use and 2', () => {
  const good = command(fixturePath('packed.onnx'));
  assert.equal(good.status, 0, good.text);
  assert.match(good.text, /time +float32 \[1\] +time, unit seconds/);
  assert.match(good.text, /keeps the contract \(header/);
  const bad = command(fixturePath('faulty-values.onnx'), '--run');
  assert.equal(bad.status, 1, bad.text);
  for (const part of [
    '5 faults',
    'colors of row 6',
    'contract/covariance',
    'in 3 of 64 rows',
    'found NaN',
    'found 65',
    'found 1.5',
  ]) {
    assert.ok(bad.text.includes(part), `${part} in ${bad.text}`);
  }
  assert.match(command(fixturePath('canonical.onnx')).text, /Warning: no contract was found/);
  const missing = command('no-such.onnx');
  assert.equal(missing.status, 1);
  assert.match(missing.text, /no-such\.onnx.*ENOENT.*Check the path/s);
  for (const args of [[], ['a', 'b'], ['--nonsense']]) assert.equal(command(...args).status, 2, args.join());
  assert.equal(command('--help').status, 0);
});

test('bounds are held against runs at defaults; controls may leave them', async () => {
  const path = join(folder, 'bounds.json');
  const contract = JSON.parse(readFileSync(fixturePath('packed-sh-half.contract.json'), 'utf8')) as object;
  const checkWith = async (minZ: number): Promise<string[]> => {
    writeFileSync(path, JSON.stringify({ ...contract, bounds: { min: [-1, -1, minZ], max: [1, 1, 1] } }));
    return codes(await checkModel(fixturePath('packed-sh-half.onnx'), { contract: path, run: true }));
  };
  // The upper half of the ball is live by default, and all of it with the control at its maximum.
  assert.deepEqual([await checkWith(0), await checkWith(0.5)], [[], ['contract/conflict']]);
});

test('--contract counts before the file beside the model', async () => {
  const path = join(folder, 'own.json');
  writeFileSync(path, JSON.stringify({ version: 1, inputs: {}, outputs: { layout: 'image', image: 'x' } }));
  const report = await checkModel(fixturePath('split.onnx'), { contract: path });
  assert.deepEqual(codes(report), ['contract/missing-tensor', 'contract/unbound-input', 'contract/unbound-input']);
  writeFileSync(path, '{');
  assert.deepEqual(codes(await checkModel(fixturePath('split.onnx'), { contract: path })), ['contract/json']);
});

test('external data that is missing or short', async () => {
  copyFileSync(fixturePath('external.onnx'), join(folder, 'external.onnx'));
  const report = (): Promise<CheckReport> => checkModel(join(folder, 'external.onnx'), { run: true });
  assert.deepEqual(codes(await report()), ['contract/external-data']);
  writeFileSync(join(folder, 'external.weights'), readFileSync(fixturePath('external.weights')).subarray(0, 6000));
  assert.deepEqual(codes(await report()), ['contract/external-data']);
  copyFileSync(fixturePath('external.weights'), join(folder, 'external.weights'));
  assert.deepEqual(codes(await report()), []);
});

test('files that are no models', async () => {
  for (const [content, code] of [
    ['<!doctype html><title>404</title>', 'decode/html'],
    ['', 'decode/unknown-format'],
    [fixtureBytes('packed.onnx').subarray(0, 3000), 'decode/truncated'],
  ] as const) {
    writeFileSync(join(folder, 'bad.onnx'), content);
    assert.deepEqual(codes(await checkModel(join(folder, 'bad.onnx'))), [code]);
  }
});

test('a model on a server, with its sidecar and its weights', async () => {
  const server = createServer((request, response) => {
    const { pathname, search } = new URL(request.url ?? '', 'http://x');
    const name = basename(pathname);
    if (pathname.startsWith('/signed/') && search !== '?token=a') return void response.writeHead(403).end();
    // Every unknown path gets a page with status 200, as many servers do it.
    const known = ['split.onnx', 'split.contract.json', 'external.onnx', 'external.weights'].includes(name);
    response.end(known ? readFileSync(fixturePath(name)) : '<!doctype html><p>Welcome');
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  const base = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
  try {
    const split = await checkModel(`${base}/split.onnx`, { run: true });
    assert.deepEqual(codes(split), []);
    assert.match(formatReport('split', split, true), /file beside the model/);
    const external = await checkModel(`${base}/external.onnx`, { run: true });
    assert.deepEqual([codes(external), external.warnings.length > 0], [[], true]);
    assert.deepEqual(codes(await checkModel(`${base}/other.onnx`)), ['decode/html']);
    for (const name of ['split', 'external'])
      assert.deepEqual(codes(await checkModel(`${base}/signed/${name}.onnx?token=a`, { run: true })), [], name);
  } finally {
    server.closeAllConnections();
    server.close();
  }
});

test(
  'real decoders of Octree-GS alone are not generators, and the checker explains why',
  { skip: needsSharedData },
  async () => {
    for (const name of ['color', 'cov', 'opacity']) {
      const report = await checkModel(sharedPath(`generators/octree-gs/${name}_mlp.onnx`), { run: true });
      assert.deepEqual([...new Set(codes(report))], ['contract/inference']);
      const text = formatReport(name, report, true);
      assert.match(text, /ai\.onnx 10/);
      assert.match(text, /float32 \[\w+, 1, 1, 35\]/);
    }
  },
);

test('--draft writes the contract that a file lacks, asks about properties that no header has, and never overwrites one', () => {
  const path = join(folder, 'drafted #1.onnx');
  const header = fixtureBytes('split.onnx');
  writeFileSync(path, header);
  const first = command(path, '--draft');
  assert.equal(first.status, 0, first.text);
  assert.match(first.text, /opacityActivation/);
  assert.match(first.text, /Then: gaussian-check ".*" --run/);
  const contract = JSON.parse(readFileSync(join(folder, 'drafted #1.contract.json'), 'utf8')) as {
    outputs: Record<string, string>;
  };
  assert.deepEqual(contract.outputs.layout, 'split');
  for (const name of ['positions', 'scales', 'rotations', 'sh', 'opacities']) assert.ok(contract.outputs[name], name);
  // The question is the only fault: this file writes logarithms and logits.
  const { text } = command(path, '--run');
  assert.match(text, /: 2 faults\n.*declare scaleActivation "log".*\n.*declare opacityActivation "logit"/);
  const again = command(path, '--draft');
  assert.equal(again.status, 1);
  assert.match(again.text, /exists already/);
  const carrying = join(folder, 'carrying.onnx');
  writeFileSync(carrying, fixtureBytes('packed.onnx'));
  const refused = command(carrying, '--draft');
  assert.equal(refused.status, 1);
  assert.match(refused.text, /contains its contract/);
  assert.equal(command(carrying, '--draft', '--run').status, 2);
});

test('names of any length in a contract make neither long tables nor long messages', async () => {
  const path = join(folder, 'named.onnx');
  writeFileSync(path, fixtureBytes('split.onnx'));
  const long = 'n'.repeat(200_000);
  const own = JSON.parse(readFileSync(fixturePath('split.contract.json'), 'utf8')) as { outputs: object };
  const contract = { ...own, name: long, outputs: { ...own.outputs, opacities: long } };
  writeFileSync(join(folder, 'named.contract.json'), JSON.stringify(contract));
  const report = await checkModel(path);
  assert.ok(codes(report).includes('contract/missing-tensor'), codes(report).join());
  const lines = formatReport('named', report, false).split('\n');
  assert.ok(Math.max(...lines.map(({ length }) => length)) < 5000);
  const single = new ContractError([
    { code: 'contract/shape', where: long, expected: long, found: long, remedy: long },
  ]);
  assert.ok(single.message.length < 5000);
});

/**
 * Outputs of some fixtures' runs in words of the tables: the page must report the same
 * (tests/check/browser/check-page.lab.test.ts).
 */
const RUNS = JSON.parse(readFileSync(join(root, 'tests/fixtures/check-runs.json'), 'utf8')) as Record<
  string,
  string[][]
>;

for (const [name, expected] of Object.entries(RUNS)) {
  test(`${name}: runs, rows and boxes as the page has them`, async () => {
    const { sections, faults } = await checkModel(fixturePath(name), { run: true });
    assert.deepEqual(faults, []);
    const rows = sections.find(({ title }) => title === 'Runs')?.rows;
    assert.deepEqual(
      rows?.map((row) => row.slice(0, 3)),
      expected,
    );
  });
}
