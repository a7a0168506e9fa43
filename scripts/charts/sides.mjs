/**
 * `npm run lab:sides:chart`: splats that a frame takes for each that shows, with and without visible sets, and how far its picture is from the whole one: views from all around
 * a scene, at growing distances, none of them one that it was looked at from; with `--step DEGREES` views that follow one another on a circle. Prints a table for docs/decisions/0017.
 */
import { readFileSync } from 'node:fs';
import { basename } from 'node:path';
import { parseArgs } from 'node:util';
import { boundsOf } from '@gaussian-splat/core';
import { lookAround } from '@gaussian-splat/economise';
import { readScene } from '@gaussian-splat/formats';
import { GaussianBuffers, packGaussians, Renderer } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { cameraAt, decibels, draw, meanSquare, numbers } from './views.mjs';

const { values, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    size: { type: 'string', default: '960x540' },
    distances: { type: 'string', default: '0.3,0.5,1,2,4' },
    views: { type: 'string', default: '8' },
    look: { type: 'string' },
    step: { type: 'string' },
  },
});
const [width, height] = values.size.split('x').map(Number);
const scenes = positionals.length > 0 ? positionals : ['demo/scenes/skull.spz'];
const device = await (await requestNodeAdapter()).requestDevice();
// A processor is no place for the variants that share work.
const { architecture = '' } = device.adapterInfo ?? {};
const variants = architecture.includes('swiftshader') ? { threads: 'serial', sort: 'serial' } : {};
const exact = new Renderer(device, { rasterizer: 'tiles', ...variants });
const some = new Renderer(device, { rasterizer: 'tiles', ...variants, visibleSets: true });

/** Azimuth and elevation of a view, radians. */
function directionOf(view, distance) {
  if (values.step !== undefined) return [0.4 + (Number(values.step) * view * Math.PI) / 180, 0.46];
  return [0.4 + (2 * Math.PI * view) / Number(values.views) + 0.1 * distance, 0.35 + 0.45 * Math.sin(1.7 * view)];
}

const median = (list) => [...list].sort((a, b) => a - b)[Math.floor(list.length / 2)];

console.log(
  '| scene | distance | all: drawn for one that shows, median (most) | visible sets: the same | dB together (worst view) |',
);
console.log('|---|---|---|---|---|');
for (const scene of scenes) {
  const cloud = await readScene(new Uint8Array(readFileSync(scene)), { name: scene });
  const bounds = boundsOf(cloud);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const start = performance.now();
  const sided = await lookAround(device, gaussians, bounds, { size: values.look && Number(values.look) });
  console.error(
    `${basename(scene)}: ${cloud.count} splats looked at in ${((performance.now() - start) / 1000).toFixed(2)} s`,
  );
  for (const distance of numbers(values.distances)) {
    const found = { all: [], sets: [], errors: [] };
    for (let view = 0; view < Number(values.views); view++) {
      const [azimuth, elevation] = directionOf(view, distance);
      const camera = cameraAt(bounds, { width, height }, distance, azimuth, elevation);
      const whole = await draw(device, exact, gaussians, camera);
      const { pixels, visible } = await draw(device, some, sided, camera);
      found.all.push(whole.visible / whole.contributing);
      found.sets.push(visible / whole.contributing);
      found.errors.push(meanSquare(whole.pixels, pixels));
    }
    const ratio = (list) => `${median(list).toFixed(2)} (${Math.max(...list).toFixed(2)})`;
    const together = decibels(found.errors.reduce((a, b) => a + b) / found.errors.length);
    const figures = `${together.toFixed(1)} (${decibels(Math.max(...found.errors)).toFixed(1)})`;
    console.log(`| ${basename(scene)} | ${distance} | ${ratio(found.all)} | ${ratio(found.sets)} | ${figures} |`);
  }
  sided.destroy();
}
process.exit();
