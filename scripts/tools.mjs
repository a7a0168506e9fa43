/**
 * `npm run lab -- tools`: converts one scene with the newest versions of public tools, reads their output, has them read our output, and prints how far places, sizes
 * and opacities are from the source. It needs the npm registry.
 */
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { dirname, join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { zipSync } from 'fflate';
import { tsImport } from 'tsx/esm/api';
import { ensureDependencies } from './lib/prepare.mjs';
import { must } from './lib/run.mjs';

ensureDependencies();
must(process.execPath, ['scripts/build.mjs', '--packages']);
const { readScene, upright } = await import('@gaussian-splat/formats');
const { encodingsFor } = await import('@gaussian-splat/optimize');

const COUNT = 400;
const folder = mkdtempSync(join(tmpdir(), 'gaussian-splat-tools-'));
const at = (name) => join(folder, name);

/** Splats of degree 1 with different opacities, above one another in the order of their numbers: no turn or mirror leaves them in place. */
function sourceCloud() {
  const places = Array.from({ length: COUNT }, (_, i) => [
    Math.sin(7 * i),
    -2 + (3 * i) / COUNT,
    1.5 * Math.cos(5 * i),
  ]);
  const quaternions = places.map(([x, y, z]) => {
    const size = Math.hypot(1, x, y, z);
    return [1 / size, x / size, y / size, z / size];
  });
  return {
    count: COUNT,
    origin: [0, 0, 0],
    positions: Float32Array.from(places.flat()),
    scales: Float32Array.from({ length: 3 * COUNT }, (_, k) => 0.01 + 0.05 * (k % 3)),
    rotations: Float32Array.from(quaternions.flat()),
    opacities: Float32Array.from({ length: COUNT }, (_, i) => 0.1 + (0.85 * i) / COUNT),
    sh: Float32Array.from({ length: 12 * COUNT }, (_, k) => 0.3 * Math.sin(k)),
    shDegree: 1,
    antialiased: false,
    droppedCount: 0,
  };
}

/** Largest distance of a splat from its source, in units of the scene; and of opacities. Tools may reorder splats. */
function distance(found, source) {
  const order = Array.from({ length: found.count }, (_, i) => i).sort(
    (a, b) => found.positions[3 * a + 1] - found.positions[3 * b + 1],
  );
  let [place, opacity] = [0, 0];
  order.forEach((j, i) => {
    for (let k = 0; k < 3; k++)
      place = Math.max(place, Math.abs(found.positions[3 * j + k] - source.positions[3 * i + k]));
    opacity = Math.max(opacity, Math.abs(found.opacities[j] - source.opacities[i]));
  });
  return { place, opacity };
}

const sparkVersion = () => JSON.parse(readFileSync('node_modules/@sparkjsdev/spark/package.json', 'utf8')).version;

/** A RAD as the SPZ that Spark makes of it. */
async function transcodedBySpark(rad) {
  const { transcodeSpz } = await import('@sparkjsdev/spark');
  const inputs = [{ fileBytes: rad, fileType: 'rad' }];
  // Its module does not report when its WebAssembly is loaded.
  for (let tries = 0; ; tries++) {
    try {
      return (await transcodeSpz({ inputs, maxSh: 3 })).fileBytes;
    } catch (error) {
      if (tries > 50 || !/undefined/.test(error.message)) throw error;
      await new Promise((resolve) => setTimeout(resolve, 100));
    }
  }
}

const rows = [];
async function judge(tool, name) {
  const openFile = async (path) => readFileSync(join(dirname(at(name)), path));
  const found = upright(await readScene(readFileSync(at(name)), { name, openFile }));
  const { place, opacity } = distance(found, source);
  const isRight = found.count === COUNT && place < 0.05 && opacity < 0.02;
  rows.push({ tool, file: name, splats: found.count, place, opacity, isRight });
}

const source = sourceCloud();
try {
  writeFileSync(at('package.json'), '{}');
  execFileSync('npm', ['install', '--no-audit', '--no-fund', '@playcanvas/splat-transform@latest', 'spz-js@latest'], {
    cwd: folder,
    stdio: 'ignore',
  });
  const require = createRequire(at('package.json'));
  const versionOf = (name) =>
    JSON.parse(readFileSync(join(folder, 'node_modules', name, 'package.json'), 'utf8')).version;
  const transform = `splat-transform ${versionOf('@playcanvas/splat-transform')}`;
  const run = (...args) =>
    execFileSync(process.execPath, ['node_modules/@playcanvas/splat-transform/bin/cli.mjs', ...args], { cwd: folder });
  const degrees = new Uint8Array(COUNT).fill(1);
  const write = (name) => encodingsFor(name).at(-1).write({ cloud: source, degrees });
  writeFileSync(at('source.ply'), await write('source.ply'));

  for (const name of ['spz-3.spz', 'spz-4.spz', 'a.glb', 'a.compressed.ply', 'a.ply']) {
    const version = /spz-(\d)/.exec(name)?.[1];
    run('-q', 'source.ply', ...(version ? ['--spz-version', version] : []), name);
    await judge(transform, name);
  }
  for (const name of ['ours.spz', 'ours.ply']) {
    writeFileSync(at(name), await write(name));
    const back = name.replace('.', '-').concat('-by-splat-transform.ply');
    run('-q', name, back);
    await judge(transform, back);
  }
  const spz = await import(pathToFileURL(require.resolve('spz-js')).href);
  const { loadPly, serializeSpz } = spz.default ?? spz;
  const stream = new Response(readFileSync(at('source.ply'))).body;
  writeFileSync(at('spz-js.spz'), new Uint8Array(await serializeSpz(await loadPly(stream))));
  await judge(`spz-js ${versionOf('spz-js')}`, 'spz-js.spz');
  // The tests' writer of RAD: what Spark's decoder makes of it, and what our reader does.
  const { writeRad } = await tsImport('../tests/formats/support/rad-writer.ts', import.meta.url);
  const sh = Float32Array.from({ length: 48 * COUNT }, (_, k) => 0.3 * Math.sin(k));
  const rad = new Uint8Array(writeRad({ ...source, sh, shDegree: 3 }, { chunkSize: 128 })['scene.rad']);
  writeFileSync(at('a.rad'), rad);
  await judge('after spark-lib', 'a.rad');
  writeFileSync(at('a-by-spark.spz'), await transcodedBySpark(rad));
  await judge(`spark ${sparkVersion()}`, 'a-by-spark.spz');
  // The tests' writer of LCC, whose z axis points up, and the decoder of splat-transform.
  const { writeLcc } = await tsImport('../tests/formats/support/lcc-writer.ts', import.meta.url);
  const { transformCloud } = await tsImport('../packages/formats/src/transform/transform-cloud.ts', import.meta.url);
  const raised = structuredClone({ ...source, sh, shDegree: 3 });
  transformCloud(raised, [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0]);
  mkdirSync(at('lcc'));
  for (const [path, bytes] of Object.entries(writeLcc([raised], { cellSize: 64 })))
    writeFileSync(at(join('lcc', path)), bytes);
  await judge('after ply2lcc', 'lcc/meta.lcc');
  run('-q', 'lcc/meta.lcc', 'lcc-by-splat-transform.ply');
  await judge(transform, 'lcc-by-splat-transform.ply');
  const { writeSog } = await tsImport('../tests/formats/support/sog-writer.ts', import.meta.url);
  writeFileSync(at('lcc/a.sog'), zipSync(writeSog(raised)));
  const root = { splatFiles: ['a.sog'], child: [{ data: { '3dgs': { name: 0 } } }] };
  const meta = { totalLevels: 1, totalSplats: COUNT, lodSplats: [COUNT], root };
  writeFileSync(at('lcc/meta.lcc2'), JSON.stringify(meta));
  await judge('after splat-transform', 'lcc/meta.lcc2');
  run('-q', 'lcc/meta.lcc2', 'lcc2-by-splat-transform.ply');
  await judge(transform, 'lcc2-by-splat-transform.ply');
} finally {
  rmSync(folder, { recursive: true, force: true });
}
for (const { tool, file, splats, place, opacity, isRight } of rows)
  console.log(
    `${isRight ? 'right' : 'WRONG'}  ${tool.padEnd(24)} ${file.padEnd(36)} ${splats} splats, places ${place.toExponential(1)}, opacities ${opacity.toExponential(1)}`,
  );
if (rows.some(({ isRight }) => !isRight)) process.exitCode = 1;
