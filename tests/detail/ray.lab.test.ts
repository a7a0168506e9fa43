/** Parts of a scene on a local Ray cluster of four workers: one is killed, and the bytes are those of one run. */
import assert from 'node:assert/strict';
import { execFileSync, spawn, spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { setTimeout } from 'node:timers/promises';
import { writePly } from '../formats/support/ply-writer.js';
import { inriaColumns, rawSplats } from '../formats/support/splats.js';
import { onlyInLab } from '../support/extent.js';

const folder = mkdtempSync(join(tmpdir(), 'gs-ray-'));
after(() => rmSync(folder, { recursive: true }));

const HERE = 'packages/cli/src/lib/detail';
const BIN = join(process.cwd(), 'packages/cli/bin/gaussian-splat.mjs');

/** Returns a Python with Ray: that of `RAY_PYTHON`, or of an environment in the cache. A reason if there is none. */
function pythonWithRay(): { python?: string; reason?: string } {
  const python = process.env.RAY_PYTHON ?? '.cache/ray/bin/python';
  if (!existsSync(python)) {
    spawnSync('python3', ['-m', 'venv', '.cache/ray']);
    const { status, stderr } = spawnSync(python, ['-m', 'pip', 'install', '-r', `${HERE}/requirements.txt`], {
      encoding: 'utf8',
    });
    if (status !== 0) {
      rmSync('.cache/ray', { recursive: true, force: true });
      return { reason: `Ray cannot be installed from PyPI: ${stderr?.trim().split('\n').at(-1)}` };
    }
  }
  return { python };
}

/** The processes that build a part into a folder: their ids and those of their Ray workers. */
function buildersOf(out: string): { pid: number; worker: number }[] {
  const lines = execFileSync('ps', ['-eo', 'pid=,ppid=,args='], { encoding: 'utf8' }).split('\n');
  return lines
    .filter((line) => line.includes(out) && line.includes('--part') && line.includes(BIN) && !line.includes('on_ray'))
    .map((line) => line.trim().split(/\s+/).map(Number))
    .map(([pid, worker]) => ({ pid, worker }));
}

test('four workers, one of them killed: the same bytes', { skip: onlyInLab, timeout: 600_000 }, async (t) => {
  const { python, reason } = pythonWithRay();
  if (python === undefined) return t.skip(reason);
  const scene = join(folder, 'scene.ply');
  writeFileSync(scene, writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(60_000, 0)) }]));
  const [once, out] = [join(folder, 'once'), join(folder, 'out')];
  const build = [process.execPath, BIN, 'detail', scene, '--memory', '302MB'];
  execFileSync(build[0], [...build.slice(1), '--out', once]);
  const args = [`${HERE}/on_ray.py`, '--parts', '4', '--local', '4', '--', ...build, '--out', out];
  const env = { ...process.env, RAY_TMPDIR: folder };
  const driver = spawn(python, args, { env, stdio: ['ignore', 'pipe', 'pipe'] });
  try {
    let text = '';
    for (const stream of [driver.stdout, driver.stderr]) stream.on('data', (data: Buffer) => (text += data.toString()));
    let builders = buildersOf(out);
    while (builders.length < 4 && driver.exitCode === null) {
      await setTimeout(20);
      builders = buildersOf(out);
    }
    assert.equal(new Set(builders.map(({ worker }) => worker)).size, 4, `four workers: ${text}`);
    for (const pid of [builders[1].worker, builders[1].pid]) process.kill(pid, 'SIGKILL');
    const status = await new Promise((ended) => driver.once('exit', ended));
    assert.equal(status, 0, text);
    assert.equal(text.match(/^part \d of 4/gm)?.length, 4, text);
  } finally {
    driver.kill();
  }
  const pages = readdirSync(join(once, 'pages'));
  assert.deepEqual(readdirSync(join(out, 'pages')), pages);
  for (const name of ['detail.json', ...pages.map((page) => join('pages', page))])
    assert.ok(readFileSync(join(out, name)).equals(readFileSync(join(once, name))), name);
});
