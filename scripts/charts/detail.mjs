/**
 * `npm run lab -- detail-chart`: how many splats a frame draws for each that contributes, and the error of its image against the whole scene, at growing distances. Draws a
 * scene exactly and from its levels of detail on Dawn, and prints a table for docs/decisions/0013.
 */
import { readFileSync } from 'node:fs';
import { parseArgs } from 'node:util';
import { boundsOf } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { packWithDetail } from '@gaussian-splat/renderer/tools';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { cameraAt, decibels, draw, meanSquare, numbers } from './views.mjs';

const { values } = parseArgs({
  options: {
    scene: { type: 'string', default: 'demo/scenes/skull.spz' },
    size: { type: 'string', default: '240x160' },
    distances: { type: 'string', default: '0.25,0.5,1,2,4' },
    detail: { type: 'string', default: '0.3,0.5,0.7,1' },
  },
});
const [width, height] = values.size.split('x').map(Number);

const device = await (await requestNodeAdapter()).requestDevice();
const cloud = await readScene(new Uint8Array(readFileSync(values.scene)), { name: values.scene });
const bounds = boundsOf(cloud);
const plain = await GaussianBuffers.upload(device, packGaussians(cloud));
const detailed = await GaussianBuffers.upload(device, packWithDetail(cloud));

console.log(
  `| distance | exact: drawn, for one that contributes | ${numbers(values.detail)
    .map((px) => `${px} px: PSNR in dB, only of splats that contribute to the exact frame`)
    .join(' | ')} |`,
);
console.log(
  `|---|---|${numbers(values.detail)
    .map(() => '---|')
    .join('')}`,
);
for (const distance of numbers(values.distances)) {
  const camera = cameraAt(bounds, { width, height }, distance);
  const exact = await draw(device, plain, camera);
  const cells = [];
  for (const detail of numbers(values.detail)) {
    const { pixels, visible, contributing } = await draw(device, detailed, camera, detail);
    cells.push(
      `${decibels(meanSquare(exact.pixels, pixels)).toFixed(1)} dB, ${(visible / exact.contributing).toFixed(2)} (${(visible / contributing).toFixed(2)} of its own)`,
    );
  }
  console.log(
    `| ${distance} | ${exact.visible}, ${(exact.visible / exact.contributing).toFixed(2)} | ${cells.join(' | ')} |`,
  );
}
process.exit();
