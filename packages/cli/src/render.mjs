/**
 * Implementation of `gaussian-splat render`: draws one image of scenes with the renderer of the element, and measures
 * depth and identity.
 */
import { basename, resolve } from 'node:path';
import { cameraFromCalibration } from '@gaussian-splat/core';
import { isClip } from './lib/clip-frame.mjs';
import { parseSceneOptions, report, runCommand, sayWarnings, UsageError } from './lib/command.mjs';
import {
  DRAW_OPTIONS,
  encodePng,
  openSceneRenderer,
  readDrawOptions,
  readSceneFile,
  toBytes,
} from './lib/draw-scene.mjs';
import { readJson } from './lib/input-file.mjs';
import { checkMapFile, encodeMap } from './lib/map-files.mjs';
import { checkOutput, isSameFile, writeWhole } from './lib/output-file.mjs';

/** Options that write a map: the member of the measured image, and the name of its channel. */
const MAPS = {
  depth: ['depth', 'Z'],
  'expected-depth': ['expectedDepth', 'Z'],
  coverage: ['coverage', 'A'],
  ids: ['ids', 'id'],
};

const USAGE = `usage: gaussian-splat render SCENE --camera CAMERA.json --out IMAGE.png [options]

  --camera FILE        one view: {width, height, K (3x3, pixels), worldToCamera (4x4, OpenCV axes)}, optionally near and far,
                       orthographic (true) or fisheye ([k1, k2, k3, k4] of OpenCV); or {views: [...]} together with --view NAME
  --beside FILE        another scene in the same image; may be repeated
  --out FILE           8-bit PNG, alpha not premultiplied
  --float FILE         width*height*4 little-endian float32, premultiplied RGBA, row by row from the top
  --depth FILE         median depth, units of the scene along the optical axis: .npy, .exr (channel Z), or .png of 16 bits.
                       0 for no surface. The depth for robots: docs/guide/depth.md
  --expected-depth FILE   mean depth by the weights of the splats, in the same formats
  --coverage FILE      opacity of all splats, 0..1 (in .png 0..65535)
  --ids FILE           1 for pixels of SCENE, 2 for those of the first --beside ..., 0 for none
  --depth-unit LENGTH  depth of one step of a .png (default 0.001: millimeters if the scene is in meters)
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
  const files = Object.fromEntries(['out', 'float', ...Object.keys(MAPS)].map((name) => [name, text]));
  const parsed = parseSceneOptions(args, {
    ...files,
    beside: { type: 'string', multiple: true },
    camera: text,
    view: text,
    time: text,
    'depth-unit': { type: 'string', default: '0.001' },
    ...DRAW_OPTIONS,
  });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  const scenes = [parsed.scene, ...(values.beside ?? [])];
  if (values.camera === undefined) throw new UsageError('--camera is missing');
  const outputs = Object.fromEntries(
    Object.keys(files).flatMap((name) => (values[name] ? [[name, values[name]]] : [])),
  );
  if (Object.keys(outputs).length === 0)
    throw new UsageError('expected an output, such as --out, --float or --depth, found none');
  if (values.time !== undefined && !scenes.some(isClip))
    throw new UsageError(`--time: expected a clip (.gsv or .4dgs), found ${scenes.join(', ')}, which does not change`);
  if (!(Number(values.time ?? 0) >= 0))
    throw new UsageError(`--time: expected seconds from 0 on, found "${values.time}"`);
  const unit = Number(values['depth-unit']);
  if (!(unit > 0)) throw new UsageError(`--depth-unit: expected a length above 0, found "${values['depth-unit']}"`);
  const maps = Object.keys(outputs).filter((name) => name in MAPS);
  for (const name of maps) checkMapFile(name, outputs[name]);
  const drawing = readDrawOptions(values);
  const camera = readCamera(values.camera, values.view);
  const isMeasured = maps.length > 0 || camera.fisheye !== undefined;
  if (isMeasured && drawing.raster === 'quads')
    throw new UsageError('--raster: expected tiles or auto, found quads, which cannot measure depth or draw a fisheye');
  if (isMeasured) drawing.raster = 'tiles';
  return { scenes, outputs, maps, unit, drawing, isMeasured, camera, cameraFile: values.camera, time: values.time };
}

function readCamera(path, name) {
  let content;
  try {
    content = readJson(resolve(path));
  } catch (error) {
    throw new UsageError(`--camera: cannot read ${path} as JSON: ${error.message}`);
  }
  const views = content?.views;
  if (views === undefined) return cameraOf(content, basename(path));
  if (!Array.isArray(views))
    throw new UsageError(`--camera: expected a list of views in ${path}, found ${typeof views}`);
  const view = views.find((v, i) => v?.name === name || String(i) === name);
  if (view === undefined) {
    const names = views.map((v, i) => v?.name ?? i).join(', ');
    throw new UsageError(`--view: expected one of ${names} (${path} holds several views), found ${name ?? 'nothing'}`);
  }
  return cameraOf(view, `${basename(path)}: view ${name}`);
}

/** Returns the camera of a view; with `fisheye` a `FisheyeCamera` of the renderer. */
const cameraOf = (view, where) => ({
  ...cameraFromCalibration(view, where),
  ...(view.fisheye && { fisheye: view.fisheye }),
});

/** Checks before rendering that outputs can be written, and that all of them differ from the inputs and each other. */
function checkFiles({ scenes, cameraFile, outputs }) {
  const inputs = Object.fromEntries([...scenes, cameraFile].map((path) => [path, path]));
  const names = Object.keys(outputs);
  for (const [i, option] of names.entries()) {
    checkOutput(option, outputs[option], inputs);
    const same = names.slice(0, i).find((name) => isSameFile(resolve(outputs[name]), resolve(outputs[option])));
    if (same) throw new UsageError(`--${option}: expected another file than that of --${same}`);
  }
}

async function readScenes({ scenes, time }) {
  const clouds = [];
  for (const scene of scenes) {
    clouds.push(await readSceneFile(scene, Number(time ?? 0)));
    sayWarnings(scene, clouds.at(-1));
  }
  return clouds;
}

async function render(options) {
  checkFiles(options);
  const { outputs, maps, scenes, unit, camera } = options;
  const clouds = await readScenes(options);
  const renderer = await openSceneRenderer(clouds[0], options.drawing);
  for (const cloud of clouds.slice(1)) await renderer.add(cloud);
  const measured = options.isMeasured ? await renderer.measure(camera) : undefined;
  const pixels = measured?.color ?? (await renderer.draw(camera));
  const { viewpoint, accumulation, mode, adapterName } = renderer;
  const statistics = await viewpoint.stats();

  report({ splats: clouds.reduce((total, { count }) => total + count, 0) });
  const { width, height } = camera;
  if (outputs.out) writeWhole(resolve(outputs.out), encodePng(toBytes(pixels), width, height));
  if (outputs.float) writeWhole(resolve(outputs.float), new Uint8Array(pixels.buffer));
  for (const name of maps) {
    const [member, channel] = MAPS[name];
    const step = { coverage: 1 / 0xffff, ids: 1 }[name] ?? unit;
    const map = { values: measured[member], width, height, channel, step };
    writeWhole(resolve(outputs[name]), encodeMap(outputs[name], map));
  }
  const sum = (member) => clouds.reduce((total, cloud) => total + cloud[member], 0);
  const degree = Math.max(...clouds.map(({ shDegree }) => shDegree));
  console.log(
    `${scenes.join(', ')}: ${sum('count')} splats, SH degree ${degree}, ${mode}; ` +
      `${sum('droppedCount')} unusable splats left out; ${statistics.visible} visible; ` +
      `${width}x${height} by ${viewpoint.rasterizer} in ${accumulation} on ${adapterName}`,
  );
}

await runCommand(USAGE, parseOptions, render, {
  name: 'render',
  endings: ['.png'],
  single: ['float', 'beside', ...Object.keys(MAPS)],
});
