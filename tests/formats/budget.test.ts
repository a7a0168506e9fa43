/**
 * The cost of a file is bounded by its bytes, however often it names the same thing: SECURITY.md gives the figures. Damaged bytes cannot show that; here references are multiplied.
 * SECURITY.md: "The size of a file bounds its cost", "Pages set their own limits".
 */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { readScene, type LoadLimits } from '@gaussian-splat/formats';
import { LoadBudget } from '../../packages/formats/dist/budget.js';
import { isLab, someOf } from '../support/extent.js';
import { expectRefusal } from './support/expect.js';
import { MULTIPLIED, type Multiplied } from './support/multiplied.js';
import { MULTIPLIED_MESHES } from './support/multiplied-meshes.js';
import { smallCloud } from './support/small-cloud.js';
import { buildGltf, writeGlb } from './support/gltf-writer.js';

const SCRIPT = fileURLToPath(new URL('./support/read-measured.ts', import.meta.url));
/**
 * Costs that grow with references show at the largest factor whose file is small enough, and at one with a tiny file;
 * the laboratory tests factors between them.
 */
const FACTORS = [10, 1_000, 30_000, 1_000_000];
/** They are for larger files. */
const MAX_FILE_BYTES = 8e6;
/** The program and what its libraries take while they work, beyond the account of SECURITY.md. */
const OWN_BYTES = 100e6;
/** Blocks of JavaScript that a small file may run: about a second. The most expensive one here runs 131 million. */
const MAX_BLOCKS = 1.6e8;

const folder = mkdtempSync(join(tmpdir(), 'budget-'));
after(() => rmSync(folder, { recursive: true }));

test('no charge takes the budget away: a number of bytes that is none is refused', () => {
  const budget = new LoadBudget(1_000);
  assert.throws(() => budget.take(NaN, 'a'), { code: 'out-of-memory/budget' });
});

interface Cost {
  readonly blocks: number;
  readonly peak: number;
  readonly result: string;
}

/** Reads files, one after the other, with the heap of a small device. */
function measured(all: readonly Multiplied[]): Cost[] {
  const paths = all.flatMap(({ file, beside, isMesh }, k) => {
    const [path, other] = [join(folder, `file${k}${isMesh ? '.mesh' : ''}`), join(folder, `beside${k}`)];
    writeFileSync(path, file);
    if (beside) writeFileSync(other, beside);
    return [path, beside ? other : ''];
  });
  const options = ['--max-old-space-size=300', '--import', 'tsx', SCRIPT, ...paths];
  const { stdout, stderr } = spawnSync(process.execPath, options, { encoding: 'utf8', timeout: 240_000 });
  const lines = stdout.trim().split('\n');
  assert.equal(lines.length, all.length, stderr.slice(-400));
  return lines.map((line) => JSON.parse(line) as Cost);
}

for (const [name, multiply] of someOf(Object.entries({ ...MULTIPLIED, ...MULTIPLIED_MESHES }), 6)) {
  test(`${name}, 10 to 1,000,000 times`, (context) => {
    const sized: { factor: number; made: Multiplied; bytes: number }[] = [];
    for (const factor of FACTORS) {
      const made = multiply(factor);
      const bytes = made.file.length + (made.beside?.length ?? 0);
      if (bytes > MAX_FILE_BYTES) break;
      sized.push({ factor, made, bytes });
    }
    const read = isLab ? sized : sized.filter((_, k) => k === 1 || k === sized.length - 1);
    const costs = measured(read.map(({ made }) => made));
    for (const [k, { factor, bytes }] of read.entries()) {
      const { blocks, peak, result } = costs[k];
      const what = `${factor} times, ${bytes} bytes: ${result}, ${blocks} blocks, ${Math.round(peak / 1e6)} MB`;
      context.diagnostic(what);
      assert.doesNotMatch(result, /unnamed|undefined/, what);
      assert.ok(peak <= OWN_BYTES + 2 ** 26 + 256 * bytes, what);
      assert.ok(blocks <= MAX_BLOCKS + 200 * bytes, what);
    }
  });
}

test('authors limit splats, memory and seconds', async () => {
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(400, 0) }]], [{ mesh: 0 }], [0]);
  const file = writeGlb(json, buffer);
  const refused = (limits: LoadLimits, message: RegExp): Promise<unknown> =>
    expectRefusal(file, 'out-of-memory/budget', message, { name: 'a.glb', ...limits });
  await refused({ maxSplats: 399 }, /expected at most 399 splats, found 400/);
  await refused({ maxBytes: file.length + 1000 }, /expected at most 1,000 bytes of memory for [\d,]+ that arrived/);
  await refused({ maxBytes: 10 }, /at most 0 bytes/);
  await refused({ maxSeconds: 0 }, /expected at most 0 s, found more/);
  const limits = { maxSplats: 400, maxBytes: 2e6, maxSeconds: 60 };
  assert.equal((await readScene(file, { name: 'a.glb', ...limits })).count, 400);
});
