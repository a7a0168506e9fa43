/** Shared parts of the charts of drawn against visible splats: views of a scene at growing distances, their images, and the visible splats. */
import { lookAt } from '@gaussian-splat/core';
import { Viewpoint, World } from '@gaussian-splat/renderer';
import { AuxiliaryOutputs } from '@gaussian-splat/renderer/tools';

/** Lowest weight, alpha times transmittance, that is visible on a display of 8 bits. */
const MIN_WEIGHT = 0.5 / 255;

export const numbers = (list) => list.split(',').map(Number);

/**
 * A view of a scene's middle. At distance 1 the scene fills the image.
 * @param azimuth, elevation of the camera, radians
 */
export function cameraAt({ center, radius }, { width, height }, distance, azimuth = 0.4, elevation = Math.atan(0.5)) {
  const far = distance * 2.5 * radius * Math.hypot(1, 0.5);
  const across = far * Math.cos(elevation);
  const eye = [
    center[0] + across * Math.cos(azimuth),
    center[1] - far * Math.sin(elevation),
    center[2] + across * Math.sin(azimuth),
  ];
  const focal = width / 2 / Math.tan(Math.PI / 6);
  return {
    ...{ width, height, fx: focal, fy: focal, cx: width / 2, cy: height / 2, near: 0.01, far: Infinity },
    worldToCamera: lookAt(eye, center, [0, -1, 0]),
  };
}

/** Reads floats of a buffer back, which `encode` fills in. */
async function read(device, size, encode) {
  const staging = device.createBuffer({ size, usage: 0x1 | 0x8 });
  const encoder = device.createCommandEncoder();
  encode(encoder, staging);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(0x1);
  const floats = new Float32Array(staging.getMappedRange().slice(0));
  staging.destroy();
  return floats;
}

/** Draws a view. @returns its pixels, splats drawn, and how many of them show */
export async function draw(device, gaussians, camera, detail = 0) {
  const { width, height } = camera;
  const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.STORAGE_BINDING | GPUTextureUsage.COPY_SRC;
  const target = device.createTexture({ size: [width, height], format: 'rgba32float', usage });
  const splats = gaussians.blocks.reduce((sum, page) => sum + 256 * Math.ceil(page.count / 256), 0);
  const contributions = device.createBuffer({ size: 4 * splats, usage: 0x80 | 0x4 });
  const world = new World();
  world.add({ scene: gaussians });
  const viewpoint = new Viewpoint(device, world, { settings: { rasterizer: 'tiles', threads: 'serial', detail } });
  do viewpoint.draw(camera, { target, auxiliary: new AuxiliaryOutputs({ contributions }) });
  while (!(await viewpoint.isComplete()));
  const { visible } = await viewpoint.stats();
  const weights = await read(device, 4 * splats, (encoder, staging) =>
    encoder.copyBufferToBuffer(contributions, 0, staging, 0, 4 * splats),
  );
  const bytesPerRow = Math.ceil((16 * width) / 256) * 256;
  const rows = await read(device, bytesPerRow * height, (encoder, buffer) =>
    encoder.copyTextureToBuffer({ texture: target }, { buffer, bytesPerRow }, [width, height]),
  );
  const pixels = new Float32Array(4 * width * height);
  for (let y = 0; y < height; y++) {
    const start = (bytesPerRow / 4) * y;
    pixels.set(rows.subarray(start, start + 4 * width), 4 * width * y);
  }
  [target, contributions, viewpoint].forEach((resource) => resource.destroy());
  return { pixels, visible, contributing: weights.reduce((sum, weight) => sum + (weight >= MIN_WEIGHT ? 1 : 0), 0) };
}

/** Mean squared difference over the pixels that the first image covers. */
export function meanSquare(a, b) {
  let [sum, count] = [0, 0];
  for (let i = 0; i < a.length; i += 4) {
    if (a[i + 3] === 0) continue;
    for (let k = 0; k < 4; k++) sum += (a[i + k] - b[i + k]) ** 2;
    count += 4;
  }
  return sum / count;
}

export const decibels = (meanSquares) => -10 * Math.log10(meanSquares);
