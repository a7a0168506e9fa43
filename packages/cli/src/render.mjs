/** Implementation of `gaussian-splat render`: draws one image of a scene with the renderer of the element. */
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
import { checkOutput, isSameFile, writeWhole } from './lib/output-file.mjs';

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
    time: text,
    ...DRAW_OPTIONS,
  });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.camera === undefined) throw new UsageError('--camera is missing');
  if (values.out === undefined && values.float === undefined) throw new UsageError('--out or --float is missing');
  if (values.time !== undefined && !isClip(parsed.scene))
    throw new UsageError(`--time: expected a clip (.gsv or .4dgs), found ${parsed.scene}, which does not change`);
  if (!(Number(values.time ?? 0) >= 0))
    throw new UsageError(`--time: expected seconds from 0 on, found "${values.time}"`);
  return { ...values, scene: parsed.scene, drawing: readDrawOptions(values) };
}

function readCamera(path, name) {
  let content;
  try {
    content = readJson(resolve(path));
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

/** Checks before rendering that outputs can be written, and that all of them differ from the inputs and each other. */
function checkFiles({ scene, camera, out, float }) {
  for (const [option, path] of Object.entries({ out, float })) {
    if (path) checkOutput(option, path, { [scene]: scene, [camera]: camera });
  }
  if (out && float && isSameFile(resolve(out), resolve(float)))
    throw new UsageError('--float: expected another file than that of --out');
}

async function render(options) {
  checkFiles(options);
  const camera = readCamera(options.camera, options.view);
  const cloud = await readSceneFile(options.scene, Number(options.time ?? 0));
  sayWarnings(options.scene, cloud);
  const renderer = await openSceneRenderer(cloud, options.drawing);
  const pixels = await renderer.draw(camera);
  const { viewpoint, accumulation, mode, adapterName } = renderer;
  const statistics = await viewpoint.stats();

  if (options.out) writeWhole(resolve(options.out), encodePng(toBytes(pixels), camera.width, camera.height));
  if (options.float) writeWhole(resolve(options.float), new Uint8Array(pixels.buffer));
  report({ splats: cloud.count });
  const { width, height } = camera;
  console.log(
    `${options.scene}: ${cloud.count} splats, SH degree ${cloud.shDegree}, ${mode}; ` +
      `${cloud.droppedCount} unusable splats left out; ${statistics.visible} visible; ` +
      `${width}x${height} by ${viewpoint.rasterizer} in ${accumulation} on ${adapterName}`,
  );
}

await runCommand(USAGE, parseOptions, render, { name: 'render', endings: ['.png'], single: ['float'] });
