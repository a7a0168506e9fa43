/** Functions of the commands that draw a scene: reading, rendering, and encoding of images. */
import { resolve } from 'node:path';
import { PNG } from 'pngjs';
import { boundsOf, SPLAT_FILTERS } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { capture, GaussianBuffers, packGaussians, Viewpoint, World } from '@gaussian-splat/renderer';
import { renderDepth, renderFisheye } from '@gaussian-splat/renderer/depth';
import { clipMoment, isClip, openClip } from './clip-frame.mjs';
import { CommandError, UsageError } from './command.mjs';
import { readerBeside, readWhole } from './input-file.mjs';
import { requestNodeDevice } from './node-gpu.mjs';

/** Command-line options that control the rendering of a scene, for `parseArgs`. */
export const DRAW_OPTIONS = {
  filter: { type: 'string' },
  mode: { type: 'string' },
  raster: { type: 'string', default: 'auto' },
  accumulation: { type: 'string', default: 'auto' },
  background: { type: 'string' },
};

/** Validates the values of {@link DRAW_OPTIONS}, and converts the background to RGBA. @throws UsageError */
export function readDrawOptions({ filter, mode, raster, accumulation, background }) {
  const checked = { filter: filter ?? mode, raster, accumulation, background: readBackground(background) };
  oneOf('--filter', checked.filter, [undefined, 'classic', 'antialiased', 'mip']);
  oneOf('--raster', raster, ['auto', 'quads', 'tiles']);
  oneOf('--accumulation', accumulation, ['auto', 'rgba16float', 'rgba32float']);
  return checked;
}

function oneOf(name, value, allowed) {
  if (allowed.includes(value)) return;
  throw new UsageError(`${name}: expected ${allowed.filter(Boolean).join(' or ')}, found "${value}"`);
}

function readBackground(text) {
  if (text === undefined) return [0, 0, 0, 0];
  const channels = text.split(',').map(Number);
  if (channels.length !== 3 || !channels.every((c) => c >= 0 && c <= 1)) {
    throw new UsageError(`--background: expected three numbers in 0..1 such as 1,1,1, found "${text}"`);
  }
  return [...channels, 1];
}

/**
 * Reads a scene. Paths of other files are relative to the folder of the scene.
 * @param name Path of the scene.
 * @param seconds Time in seconds of the frame of a clip.
 */
export async function readSceneFile(name, seconds = 0) {
  const path = resolve(name);
  if (isClip(name)) return clipMoment(await readWhole(path), name, seconds);
  return readScene(await readWhole(path), { name, openFile: readerBeside(path) });
}

/**
 * Opens a scene that may change over time. `splats(seconds)` resolves to the same cloud until the frame of a clip changes.
 * @param name Path of the scene.
 */
export async function openMovingScene(name) {
  if (!isClip(name)) {
    const cloud = await readSceneFile(name);
    return { bounds: { ...boundsOf(cloud), up: cloud.hints?.up }, splats: async () => cloud };
  }
  const clip = await openClip(await readWhole(resolve(name)), name);
  let [shown, cloud] = [-1, undefined];
  return {
    bounds: clip.bounds,
    async splats(seconds) {
      const frame = clip.frame(seconds);
      if (frame !== shown) [shown, cloud] = [frame, await clip.splats(frame)];
      return cloud;
    },
  };
}

/**
 * Opens a renderer of a scene.
 * @param options Result of {@link readDrawOptions}.
 * @returns The renderer. `show(cloud)` replaces the splats; `add(cloud)` adds a scene beside them. `draw(camera)`
 * resolves to float32 premultiplied RGBA, [height, width, 4], top row first. `measure(camera)` resolves to the
 * `DepthImage` of a renderer with `tiles`. Both reject if WebGPU's validation has reported an error.
 */
export async function openSceneRenderer(cloud, options) {
  const filterOf = (of) => (options.filter === undefined ? of : SPLAT_FILTERS[options.filter]);
  const { adapter, device } = await requestNodeDevice();
  const validationErrors = [];
  device.addEventListener('uncapturederror', ({ error }) => validationErrors.push(error.message));
  const accumulation = chooseAccumulation(options.accumulation, device);
  const world = new World();
  const viewpoint = new Viewpoint(device, world, { settings: { rasterizer: options.raster, accumulation } });
  let shown;
  const add = async (next) => {
    const { antialiased, filterVariance } = filterOf(next);
    const gaussians = await GaussianBuffers.upload(device, packGaussians({ ...next, antialiased, filterVariance }));
    return { gaussians, placement: world.add({ scene: gaussians }) };
  };
  const checked = async (drawn) => {
    const image = await drawn;
    if (validationErrors.length > 0) throw new CommandError(`WebGPU: ${validationErrors.join('\n')}`);
    return image;
  };
  const show = async (next) => {
    if (next === shown?.cloud) return;
    if (shown) world.remove(shown.placement);
    shown?.gaussians.destroy();
    shown = undefined;
    // Frames of a clip may have no splats.
    if (next.count === 0) return;
    shown = { cloud: next, ...(await add(next)) };
  };
  await show(cloud);
  return {
    show,
    add,
    viewpoint,
    accumulation,
    mode: filterOf(cloud).antialiased ? 'antialiased' : 'classic',
    adapterName: adapter.info.description || adapter.info.vendor,
    draw: (camera) => checked(capture(device, viewpoint, { camera, background: options.background })),
    measure: (camera) => {
      const measure = camera.fisheye ? renderFisheye : renderDepth;
      return checked(measure(device, viewpoint, { camera, background: options.background }));
    },
  };
}

function chooseAccumulation(asked, device) {
  if (asked !== 'auto') return asked;
  return device.features.has('float32-blendable') ? 'rgba32float' : 'rgba16float';
}

/** Converts premultiplied RGBA in float32 to bytes of RGBA with straight alpha. */
export function toBytes(pixels) {
  const bytes = new Uint8Array(pixels.length);
  const toByte = (value) => Math.round(255 * Math.min(1, Math.max(0, value)));
  for (let i = 0; i < pixels.length; i += 4) {
    const alpha = pixels[i + 3];
    for (let k = 0; k < 3; k++) bytes[i + k] = toByte(alpha > 0 ? pixels[i + k] / alpha : 0);
    bytes[i + 3] = toByte(alpha);
  }
  return bytes;
}

/** Encodes bytes of {@link toBytes} as PNG. */
export function encodePng(bytes, width, height) {
  const png = new PNG({ width, height });
  png.data.set(bytes);
  return PNG.sync.write(png);
}
