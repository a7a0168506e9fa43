/** Bundles the scripts of the benchmark pages, with the peers they measure. The pages themselves are the site's. */
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { build } from 'esbuild';
import { root } from './run.mjs';

const ENTRIES = [
  'bench',
  'detail',
  'frontier',
  'generators',
  'pace',
  'run/fetch-worker',
  'stability',
  'start',
  'world',
  'quality/oracle-worker',
  'peers/ours',
  'peers/playcanvas',
  'peers/spark',
];

/** @param folder of the pages, for example demo/dist/bench. */
export async function bundleBench(folder) {
  const from = join(root, 'benchmarks');
  await build({
    entryPoints: ENTRIES.map((name) => join(from, `${name}.js`)),
    outdir: folder,
    outbase: from,
    bundle: true,
    format: 'esm',
    target: 'es2024',
    minify: true,
    logLevel: 'warning',
    define: { BENCH_VERSIONS: JSON.stringify(versions()) },
  });
}

function versions() {
  const dependencies = JSON.parse(readFileSync(join(root, 'package.json'), 'utf8')).devDependencies;
  const renderer = JSON.parse(readFileSync(join(root, 'packages/renderer/package.json'), 'utf8')).version;
  return {
    renderer,
    commit: commit(),
    playcanvas: dependencies.playcanvas,
    spark: dependencies['@sparkjsdev/spark'],
    three: dependencies.three,
  };
}

/** The commit that was built, `-dirty` if files differ from it; `unknown` outside a checkout. */
function commit() {
  try {
    return execFileSync('git', ['describe', '--always', '--dirty'], { cwd: root, encoding: 'utf8' }).trim();
  } catch {
    return 'unknown';
  }
}
