/**
 * `npm run detail:chart`: how many splats a frame takes for each that contributes, and how far its picture is from the whole one, at growing distances. Draws a
 * scene exactly and from its levels of detail on Dawn, and prints a table for docs/decisions/0013.
 */
import { readFileSync } from 'node:fs';
import { parseArgs } from 'node:util';
import { boundsOf, lookAt } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { GaussianBuffers, packGaussians, packWithDetail, Renderer } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from './lib/node-gpu.mjs';

const { values } = parseArgs({
  options: {
    scene: { type: 'string', default: 'demo/scenes/skull.spz' },
    size: { type: 'string', default: '240x160' },
    distances: { type: 'string', default: '0.25,0.5,1,2,4' },
    detail: { type: 'string', default: '0.3,0.5,0.7,1' },
  },
});
const [width, height] = values.size.split('x').map(Number);
const numbers = (list) => list.split(',').map(Number);
/** Weight, alpha times transmittance, from which on a splat can be told on a display of 8 bits. */
const LEAST_WEIGHT = 0.5 / 255;

const device = await (await requestNodeAdapter()).requestDevice();
const cloud = await readScene(new Uint8Array(readFileSync(values.scene)), { name: values.scene });
const bounds = boundsOf(cloud);
const plain = await GaussianBuffers.upload(device, packGaussians(cloud));
const detailed = await GaussianBuffers.upload(device, packWithDetail(cloud));
const renderer = new Renderer(device, { rasterizer: 'tiles', threads: 'serial', sort: 'serial' });

function cameraAt(distance) {
  const [x, y, z] = bounds.center;
  const far = distance * 2.5 * bounds.radius;
  const eye = [x + far * Math.cos(0.4), y - 0.5 * far, z + far * Math.sin(0.4)];
  const focal = width / 2 / Math.tan(Math.PI / 6);
  return {
    ...{ width, height, fx: focal, fy: focal, cx: width / 2, cy: height / 2, near: 0.01, far: Infinity },
    worldToCamera: lookAt(eye, bounds.center, [0, -1, 0]),
  };
}

async function read(buffer, encode) {
  const staging = device.createBuffer({ size: buffer.size, usage: 0x1 | 0x8 });
  const encoder = device.createCommandEncoder();
  encode(encoder, staging);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(0x1);
  const floats = new Float32Array(staging.getMappedRange().slice(0));
  staging.destroy();
  return floats;
}

/** Draws a view. @returns its pixels, splats drawn, and how many of them contribute */
async function draw(gaussians, camera, detail) {
  const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC;
  const target = device.createTexture({ size: [width, height], format: 'rgba32float', usage });
  const splats = gaussians.pages.reduce((sum, page) => sum + 256 * Math.ceil(page.count / 256), 0);
  const contributions = device.createBuffer({ size: 4 * splats, usage: 0x80 | 0x4 });
  do renderer.render({ gaussians, camera, target, detail, notes: { contributions } });
  while (!(await renderer.isComplete()));
  const { visible } = await renderer.readStatistics();
  const weights = await read(contributions, (encoder, staging) =>
    encoder.copyBufferToBuffer(contributions, 0, staging, 0, 4 * splats),
  );
  const bytesPerRow = Math.ceil((16 * width) / 256) * 256;
  const rows = await read({ size: bytesPerRow * height }, (encoder, buffer) =>
    encoder.copyTextureToBuffer({ texture: target }, { buffer, bytesPerRow }, [width, height]),
  );
  const pixels = Array.from({ length: height }, (_, y) => {
    const start = (bytesPerRow / 4) * y;
    return [...rows.subarray(start, start + 4 * width)];
  }).flat();
  [target, contributions].forEach((resource) => resource.destroy());
  return { pixels, visible, contributing: weights.reduce((sum, weight) => sum + (weight >= LEAST_WEIGHT ? 1 : 0), 0) };
}

/** PSNR over the pixels that the first picture covers. */
function psnr(a, b) {
  let [sum, count] = [0, 0];
  for (let i = 0; i < a.length; i += 4) {
    if (a[i + 3] === 0) continue;
    for (let k = 0; k < 4; k++) sum += (a[i + k] - b[i + k]) ** 2;
    count += 4;
  }
  return -10 * Math.log10(sum / count);
}

console.log(
  `| distance | exact: drawn, for one that contributes | ${numbers(values.detail)
    .map((px) => `${px} px: dB, drawn for one that contributes to the exact picture`)
    .join(' | ')} |`,
);
console.log(
  `|---|---|${numbers(values.detail)
    .map(() => '---|')
    .join('')}`,
);
for (const distance of numbers(values.distances)) {
  const camera = cameraAt(distance);
  const exact = await draw(plain, camera, 0);
  const cells = [];
  for (const detail of numbers(values.detail)) {
    const { pixels, visible, contributing } = await draw(detailed, camera, detail);
    cells.push(
      `${psnr(exact.pixels, pixels).toFixed(1)} dB, ${(visible / exact.contributing).toFixed(2)} (${(visible / contributing).toFixed(2)} of its own)`,
    );
  }
  console.log(
    `| ${distance} | ${exact.visible}, ${(exact.visible / exact.contributing).toFixed(2)} | ${cells.join(' | ')} |`,
  );
}
process.exit();
