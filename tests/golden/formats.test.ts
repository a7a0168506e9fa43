/** One captured scene through every format: each exact to its own oracle, and near its PLY as its precision allows. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { renderOracle, type OracleImage } from '../oracle/oracle.js';
import { referenceViews } from '../support/cameras.js';
import { closeness, describeCloseness, renderCloud } from '../support/compare.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { psnr } from '../support/metrics.js';
import { nodeDevice } from '../support/node-device.js';

/** dB to the image of the PLY file that each format must keep, a little under what it was seen to keep. */
const FORMATS: readonly { readonly file: string; readonly toPly: number }[] = [
  { file: 'formats/playbot3.ply', toPly: Infinity },
  { file: 'formats/playbot3.compressed.ply', toPly: 47 },
  { file: 'formats/playbot3.niantic-v2.spz', toPly: 38 },
  { file: 'formats/playbot3.niantic-v3.spz', toPly: 40 },
  { file: 'formats/playbot3.niantic-v4.spz', toPly: 40 },
  { file: 'formats/playbot3.pc-v4.spz', toPly: 40 },
];

const load = (file: string): Promise<GaussianCloud> => readScene(sharedFile(file), { name: file });

test('one scene through every format', { skip: needsSharedData }, async () => {
  const { camera } = referenceViews().find(({ name }) => name === 'playbot3 1')!;
  const draw = (cloud: GaussianCloud): OracleImage => renderOracle(cloud, camera, { rules: 'gsplat', mode: 'classic' });
  const ply = draw(await load('formats/playbot3.ply'));
  for (const { file, toPly } of FORMATS) {
    const cloud = await load(file);
    const oracle = draw(cloud);
    const close = closeness(await renderCloud(await nodeDevice(), cloud, camera, 'classic'), oracle);
    const kept = psnr(oracle.color, ply.color, { mask: ply.contributors });
    console.log(`${describeCloseness(file, close)}, to the PLY ${kept.toFixed(2)} dB`);
    assert.ok(close.psnr >= 59, `${file}: ${close.psnr} dB to its own oracle`);
    assert.ok(kept >= toPly, `${file}: ${kept} dB to the PLY`);
  }
});

// Dawn keeps Node alive.
after(() => {
  setImmediate(() => process.exit());
});
