/** Implementation of `gaussian-splat render`: one scene, one camera, one image, with the renderer of the element. */
import { basename, dirname, join, resolve } from 'node:path';
import { PNG } from 'pngjs';
import { cameraFromCalibration, SPLAT_FILTERS } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { capture, deviceDescriptor, GaussianBuffers, packGaussians, Viewpoint, World } from '@gaussian-splat/renderer';
import { clipMoment, isClip } from './lib/clip-frame.mjs';
import { from, parseSceneOptions, runCommand, sayWarnings, UsageError } from './lib/command.mjs';
import { requestNodeAdapter } from './lib/node-gpu.mjs';
import { isSameFile, obstacleTo, writeWhole } from './lib/output-file.mjs';
import { readJson, readWhole } from './lib/input-file.mjs';

const USAGE = `usage: gaussian-splat render SCENE --camera CAMERA.json --out IMAGE.png [options]

  --camera FILE        one view: {width, height, K (3x3, pixels), worldToCamera (4x4, OpenCV axes)}, optionally near and far;
                       or {views: [...]} together with --view NAME
  --out FILE           8-bit PNG, alpha not premultiplied
  --float FILE         width*height*4 little-endian float32, premultiplied RGBA, row by row from the top
  --time SECONDS       the moment of a clip (.gsv, .4dgs; default 0), for a poster
  --view NAME          the view of that name (or number) in a file of several
  --filter NAME        classic, antialiased (0.3 px² with compensation) or mip (0.1 px²); default: what the scene file says.
                       --mode is another name of it
  --raster NAME        auto (default), quads or tiles
  --accumulation NAME  precision in which splats are blended: rgba16float (what the element shows), rgba32float, or
                       auto (default): rgba32float where the device can blend it, since no frame rate is at stake
  --background R,G,B   0..1; default: transparent
`;

function parseOptions(args) {
  const text = { type: 'string' };
  const parsed = parseSceneOptions(args, {
    camera: text,
    out: text,
    float: text,
    view: text,
    time: { ...text, default: '0' },
    filter: text,
    mode: text,
    raster: { ...text, default: 'auto' },
    accumulation: { ...text, default: 'auto' },
    background: text,
  });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.camera === undefined) throw new UsageError('--camera is missing');
  if (values.out === undefined && values.float === undefined) throw new UsageError('--out or --float is missing');
  if (!(Number(values.time) >= 0)) throw new UsageError(`--time: expected seconds from 0 on, found "${values.time}"`);
  values.filter ??= values.mode;
  oneOf('--filter', values.filter, [undefined, 'classic', 'antialiased', 'mip']);
  oneOf('--raster', values.raster, ['auto', 'quads', 'tiles']);
  oneOf('--accumulation', values.accumulation, ['auto', 'rgba16float', 'rgba32float']);
  return { ...values, scene: parsed.scene, background: parseBackground(values.background) };
}

function oneOf(name, value, allowed) {
  if (allowed.includes(value)) return;
  throw new UsageError(`${name}: expected ${allowed.filter(Boolean).join(' or ')}, found "${value}"`);
}

function parseBackground(text) {
  if (text === undefined) return [0, 0, 0, 0];
  const channels = text.split(',').map(Number);
  if (channels.length !== 3 || !channels.every((c) => c >= 0 && c <= 1)) {
    throw new UsageError(`--background: expected three numbers in 0..1 such as 1,1,1, found "${text}"`);
  }
  return [...channels, 1];
}

function readCamera(path, name) {
  let content;
  try {
    content = readJson(resolve(from, path));
  } catch (error) {
    throw new UsageError(`--camera: cannot read ${path} as JSON: ${error.message}`);
  }
  const views = content?.views;
  if (views === undefined) return cameraFromCalibration(content, basename(path));
  if (!Array.isArray(views))
    throw new UsageError(`--camera: expected a list of views in ${path}, found ${typeof views}`);
  const view = views.find((v, i) => v?.name === name || String(i) === name);
  if (view === undefined) {
    const names = views.map((v, i) => v?.name ?? i).join(', ');
    throw new UsageError(`--view: expected one of ${names} (${path} holds several views), found ${name ?? 'nothing'}`);
  }
  return cameraFromCalibration(view, `${basename(path)}: view ${name}`);
}

/** Other files of a scene are in the folder of the named one. */
async function readSceneFile(name, seconds) {
  const path = resolve(from, name);
  if (isClip(name)) return clipMoment(await readWhole(path), name, seconds);
  const openPart = (part) => readWhole(join(dirname(path), part));
  return readScene(await readWhole(path), { name, openPart });
}

/** 8-bit PNG with straight alpha, rounded to nearest. */
function encodePng(pixels, width, height) {
  const png = new PNG({ width, height });
  const toByte = (value) => Math.round(255 * Math.min(1, Math.max(0, value)));
  for (let i = 0; i < 4 * width * height; i += 4) {
    const alpha = pixels[i + 3];
    for (let k = 0; k < 3; k++) png.data[i + k] = toByte(alpha > 0 ? pixels[i + k] / alpha : 0);
    png.data[i + 3] = toByte(alpha);
  }
  return PNG.sync.write(png);
}

function chooseAccumulation(asked, device) {
  if (asked !== 'auto') return asked;
  return device.features.has('float32-blendable') ? 'rgba32float' : 'rgba16float';
}

/** Checks all paths before the work. */
function checkFiles({ scene, camera, out, float }) {
  for (const [option, path] of Object.entries({ out, float })) {
    if (!path) continue;
    const file = resolve(from, path);
    for (const read of [scene, camera])
      if (isSameFile(file, resolve(from, read)))
        throw new UsageError(`--${option}: expected another file than ${read}, which is never changed`);
    const obstacle = obstacleTo(file);
    if (obstacle) throw new UsageError(`--${option}: ${obstacle}`);
  }
  if (out && float && isSameFile(resolve(from, out), resolve(from, float)))
    throw new UsageError('--float: expected another file than that of --out');
}

async function render(options) {
  checkFiles(options);
  const camera = readCamera(options.camera, options.view);
  const cloud = await readSceneFile(options.scene, Number(options.time));
  sayWarnings(options.scene, cloud);
  const { antialiased, filterVariance } = options.filter === undefined ? cloud : SPLAT_FILTERS[options.filter];

  const adapter = await requestNodeAdapter();
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  const validationErrors = [];
  device.addEventListener('uncapturederror', ({ error }) => validationErrors.push(error.message));
  const accumulation = chooseAccumulation(options.accumulation, device);
  const world = new World();
  const viewpoint = new Viewpoint(device, world, { settings: { rasterizer: options.raster, accumulation } });
  const gaussians = await GaussianBuffers.upload(device, packGaussians({ ...cloud, antialiased, filterVariance }));
  world.add({ scene: gaussians });
  const pixels = await capture(device, viewpoint, { camera, over: options.background });
  const statistics = await viewpoint.statistics();
  if (validationErrors.length > 0) throw new Error(`WebGPU: ${validationErrors.join('\n')}`);

  if (options.out) writeWhole(resolve(from, options.out), encodePng(pixels, camera.width, camera.height));
  if (options.float) writeWhole(resolve(from, options.float), new Uint8Array(pixels.buffer));
  const { width, height } = camera;
  console.log(
    `${options.scene}: ${cloud.count} splats, SH degree ${cloud.shDegree}, ${antialiased ? 'antialiased' : 'classic'}; ` +
      `${cloud.droppedCount} unusable splats left out; ${statistics.visible} visible; ` +
      `${width}x${height} by ${viewpoint.rasterizer} in ${accumulation} on ${adapter.info.description || adapter.info.vendor}`,
  );
}

await runCommand(USAGE, parseOptions, render);
