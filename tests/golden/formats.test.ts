/** One captured scene through every format: each exact to its own oracle, and near its PLY as its precision allows. */
import assert from 'node:assert/strict';
import { dirname, join } from 'node:path';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { renderOracle, type OracleImage } from '../oracle/oracle.js';
import { referenceViews } from '../support/cameras.js';
import { closeness, compareWithOracle, describeCloseness, renderCloud } from '../support/compare.js';
import { halfTurned, needsSharedData, sharedFile } from '../support/data.js';
import { psnr } from '../support/metrics.js';
import { isFull, isLab, onlyInLab, someOf } from '../support/extent.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { resized } from '../support/scenes.js';

/** dB to the image of the PLY file that each format must keep, a little below the measured value. */
const FORMATS: readonly {
  readonly file: string;
  readonly toPly: number;
  readonly level?: number;
  /** Decodes to the same numbers as another one of the list. */
  readonly isTwin?: boolean;
}[] = [
  { file: 'formats/playbot3.ply', toPly: Infinity },
  { file: 'formats/playbot3.compressed.ply', toPly: 47 },
  { file: 'formats/playbot3.niantic-v2.spz', toPly: 38 },
  { file: 'formats/playbot3.niantic-v3.spz', toPly: 40, isTwin: true },
  { file: 'formats/playbot3.niantic-v4.spz', toPly: 40 },
  { file: 'formats/playbot3.pc-v4.spz', toPly: 40, isTwin: true },
  { file: 'formats/playbot3.glb', toPly: Infinity },
  // Colors outside 0..1 do not fit a .ksplat, and the last has degree 1 only.
  { file: 'formats/playbot3.c0.sh2.ksplat', toPly: 39.5 },
  { file: 'formats/playbot3.c1.sh2.ksplat', toPly: 39.5 },
  { file: 'formats/playbot3.c2.sh1.ksplat', toPly: 31 },
  // The PLY was made of this one.
  { file: 'scenes/playbot-streamed/3_0/meta.json', toPly: 100 },
  { file: 'scenes/playbot-streamed/lod-meta.json', toPly: 100, level: 3 },
];

const load = async (file: string, level = 0): Promise<GaussianCloud> => {
  const openFile = async (path: string): Promise<Uint8Array> => sharedFile(join(dirname(file), path));
  const cloud = await readScene(sharedFile(file), { name: file, openFile, level });
  // Made in right-up-back for these tests.
  return file.endsWith('.spz') ? halfTurned(cloud) : cloud;
};

/** Half as wide as the reference image, a third in `npm test`. */
function viewOfAll(): Camera {
  const { camera } = referenceViews().find(({ name }) => name === 'playbot3 1')!;
  return resized(camera, Math.round(camera.width / (isLab ? 2 : 3)));
}

/** Captured scenes without a PLY. */
const OTHERS = ['scenes/massa.sog', 'scenes/logo-sog-v1/meta.json'];

test('one scene through every format', { skip: needsSharedData }, async () => {
  const camera = viewOfAll();
  const draw = (cloud: GaussianCloud): OracleImage => renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' });
  const ply = draw(await load('formats/playbot3.ply'));
  for (const { file, toPly, level, isTwin } of someOf(FORMATS, 8)) {
    if (isTwin && !isFull) continue;
    const cloud = await load(file, level);
    const oracle = file === FORMATS[0].file ? ply : draw(cloud);
    const close = closeness(await renderCloud(await serialDevice(), cloud, camera, 'classic'), oracle);
    const kept = psnr(oracle.color, ply.color, { mask: ply.contributors });
    console.log(`${describeCloseness(file, close)}, to the PLY ${kept.toFixed(2)} dB`);
    assert.ok(close.psnr >= 59, `${file}: ${close.psnr} dB to its own oracle`);
    // Images of fewer pixels differ more.
    assert.ok(kept >= toPly - (isLab ? 0 : 0.5), `${file}: ${kept} dB to the PLY`);
  }
});

test('captured scenes in SOG of both versions', { skip: onlyInLab || needsSharedData }, async () => {
  const camera = viewOfAll();
  for (const file of OTHERS) {
    const close = await compareWithOracle(await serialDevice(), await load(file), camera, 'classic');
    console.log(describeCloseness(file, close));
    assert.ok(close.psnr >= 59, `${file}: ${close.psnr} dB to its own oracle`);
  }
});

after(endNodeDevice);
