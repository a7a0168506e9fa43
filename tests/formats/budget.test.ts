/**
 * What a file costs is bounded by its bytes, however often it names the same thing: SECURITY.md gives the figures. Damaged bytes cannot show that; here references are multiplied.
 */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { readScene, type LoadLimits } from '@gaussian-splat/formats';
import { isLab } from '../support/extent.js';
import { expectRefusal } from './support/expect.js';
import { MULTIPLIED, type Multiplied } from './support/multiplied.js';
import { smallCloud } from './support/small-cloud.js';
import { buildGltf, writeGlb } from './support/gltf-writer.js';

const SCRIPT = fileURLToPath(new URL('./support/read-measured.ts', import.meta.url));
/** What grows with references shows at the largest factor whose file is small enough, and at one where the file is next to nothing; the laboratory has those between. */
const FACTORS = [10, 1_000, 30_000, 1_000_000];
/** Larger files are what they are for. */
const MOST_FILE_BYTES = 8e6;
/** The program and what its libraries take while they work, beyond the account of SECURITY.md. */
const OWN_BYTES = 100e6;

const folder = mkdtempSync(join(tmpdir(), 'budget-'));
after(() => rmSync(folder, { recursive: true }));

/** Reads a file with the heap of a small device. */
function measured({ file, beside }: Multiplied): { cpuMs: number; peak: number; result: string } {
  const [path, other] = [join(folder, 'file'), join(folder, 'beside')];
  writeFileSync(path, file);
  if (beside) writeFileSync(other, beside);
  const options = ['--max-old-space-size=300', '--import', 'tsx', SCRIPT, path, beside ? other : ''];
  const { stdout, stderr } = spawnSync(process.execPath, options, { encoding: 'utf8', timeout: 120_000 });
  assert.notEqual(stdout, '', stderr.slice(-400));
  return JSON.parse(stdout) as ReturnType<typeof measured>;
}

for (const [name, multiply] of Object.entries(MULTIPLIED)) {
  test(`${name}, 10 to 1,000,000 times`, (context) => {
    const sized: { factor: number; made: Multiplied; bytes: number }[] = [];
    for (const factor of FACTORS) {
      const made = multiply(factor);
      const bytes = made.file.length + (made.beside?.length ?? 0);
      if (bytes > MOST_FILE_BYTES) break;
      sized.push({ factor, made, bytes });
    }
    for (const { factor, made, bytes } of isLab ? sized : sized.filter((_, k) => k === 1 || k === sized.length - 1)) {
      const { cpuMs, peak, result } = measured(made);
      const what = `${factor} times, ${bytes} bytes: ${result}, ${Math.round(cpuMs)} ms, ${Math.round(peak / 1e6)} MB`;
      context.diagnostic(what);
      assert.doesNotMatch(result, /unnamed|undefined/, what);
      assert.ok(peak <= OWN_BYTES + 2 ** 26 + 256 * bytes, what);
      assert.ok(cpuMs <= 1_000 + 4e-3 * bytes, what);
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
