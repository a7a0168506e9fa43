/**
 * Implementation of `gaussian-splat video`: draws frames along a camera path, as PNG files or as a video. A clip advances
 * by the duration of a frame.
 */
import { existsSync, mkdirSync, readdirSync, statSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { camerasAlong } from '@gaussian-splat/element/camera-path.js';
import { parseSceneOptions, report, runCommand, sayWarnings, UsageError } from './lib/command.mjs';
import {
  DRAW_OPTIONS,
  encodePng,
  openMovingScene,
  openSceneRenderer,
  readDrawOptions,
  toBytes,
} from './lib/draw-scene.mjs';
import { isClip } from './lib/clip-frame.mjs';
import { checkVideo, isVideo, keepsAlpha, openVideo } from './lib/ffmpeg.mjs';
import { readJson } from './lib/input-file.mjs';
import { checkOutput, obstacleToFolder, writeWhole } from './lib/output-file.mjs';

const USAGE = `usage: gaussian-splat video SCENE (--path VIEWS.json | --turntable) --out FOLDER|FILE.mp4|FILE.webm [options]

  --path FILE          what the attribute "views" of the element takes: a list of views, a cameras.json, or the
                       settings of SuperSplat, whose keyframes count. The path is that of flyPath()
  --turntable          one turn around the target instead
                       A clip (.gsv, .4dgs) plays from its beginning meanwhile; its last frame stays.
  --out PATH           a folder for frame-0000.png, frame-0001.png ... with straight alpha; or a video, for which
                       ffmpeg must be installed: .webm keeps the alpha, .mp4 has none
  --size WxH           pixels; default: 1280x720
  --fps N              frames in a second; default: 30
  --seconds N          length; default: what the path says, 8 for a turntable
  --frames N           number of frames, in place of --seconds
  --orbit, --target, --field-of-view, --up, --orthographic
                       the attributes camera-orbit, camera-target, field-of-view, up and orthographic of the element
  --background R,G,B   0..1; default: transparent, white for .mp4
  --filter, --raster, --accumulation
                       as those of "gaussian-splat render"
`;

/** Maximum number of frames of a video. */
const MAX_FRAMES = 100_000;
/** Maximum width and height of a frame in pixels. */
const MAX_PIXELS = 16_384;

function parseOptions(args) {
  const text = { type: 'string' };
  const parsed = parseSceneOptions(args, {
    ...{ path: text, turntable: { type: 'boolean' }, out: text, seconds: text, frames: text },
    ...{ size: { ...text, default: '1280x720' }, fps: { ...text, default: '30' } },
    ...{ orbit: text, target: text, 'field-of-view': text, up: text, orthographic: { type: 'boolean' } },
    ...DRAW_OPTIONS,
  });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if ((values.path === undefined) === (values.turntable !== true))
    throw new UsageError('expected either --path or --turntable');
  if (values.out === undefined) throw new UsageError('--out is missing');
  if (values.frames !== undefined && values.seconds !== undefined)
    throw new UsageError('expected either --seconds or --frames');
  const [width, height] = readSize(values.size);
  const drawing = readDrawOptions(values);
  if (isVideo(values.out) && !keepsAlpha(values.out) && values.background === undefined)
    drawing.background = [1, 1, 1, 1];
  return {
    scene: parsed.scene,
    path: values.path,
    out: values.out,
    drawing,
    ...{ width, height },
    frameRate: readNumber('--fps', values.fps, 0.01, 1000),
    seconds: readNumber('--seconds', values.seconds, 0, MAX_FRAMES),
    frames: readNumber('--frames', values.frames, 1, MAX_FRAMES, true),
    attributes: attributesOf(values),
  };
}

function attributesOf({ orbit, target, 'field-of-view': fieldOfView, up, orthographic }) {
  const all = { cameraOrbit: orbit, cameraTarget: target, fieldOfView, up, orthographic };
  return Object.fromEntries(Object.entries(all).filter(([, value]) => value !== undefined));
}

function readSize(text) {
  const sides = /^(\d+)x(\d+)$/.exec(text)?.slice(1).map(Number);
  if (!sides?.every((side) => side >= 1 && side <= MAX_PIXELS))
    throw new UsageError(`--size: expected two sides of 1 to ${MAX_PIXELS} pixels such as 1280x720, found "${text}"`);
  return sides;
}

function readNumber(name, text, min, max, isWhole = false) {
  if (text === undefined) return undefined;
  const value = Number(text);
  if (text.trim() === '' || !(value >= min && value <= max) || (isWhole && !Number.isInteger(value)))
    throw new UsageError(`${name}: expected a ${isWhole ? 'whole ' : ''}number from ${min} to ${max}, found "${text}"`);
  return value;
}

function readViews(path) {
  try {
    return readJson(resolve(path));
  } catch (error) {
    throw new UsageError(`--path: cannot read ${path} as JSON: ${error.message}`);
  }
}

/** Checks before the work that outputs can be written, and that they differ from inputs. */
function checkFiles({ scene, path, out, width, height }) {
  const target = resolve(out);
  const inputs = { [scene]: scene, [path]: path };
  if (isVideo(out)) {
    checkOutput('out', target, inputs);
    return checkVideo(target, width, height);
  }
  if (existsSync(target) && !statSync(target).isDirectory())
    throw new UsageError(`--out: expected a folder, or a file that ends in .mp4 or .webm; ${out} is a file`);
  checkOutput('out', target, inputs, obstacleToFolder);
}

const frameName = (frame, digits) => `frame-${String(frame).padStart(digits, '0')}.png`;

/** Refuses a folder with frames of an earlier run that this run would not replace, because they would mix. */
function checkFrames(folder, frames) {
  const digits = digitsOf(frames);
  const own = new Set(Array.from({ length: frames }, (_, frame) => frameName(frame, digits)));
  const other =
    existsSync(folder) && readdirSync(folder).find((name) => /^frame-\d+\.png$/.test(name) && !own.has(name));
  if (other)
    throw new UsageError(
      `--out: ${folder} has frames of another run, such as ${other}: remove them, or name another folder`,
    );
}

const digitsOf = (frames) => Math.max(4, String(frames - 1).length);

/** Opens a folder for numbered PNG files. The result has the methods of `openVideo`. */
function openFolder(folder, { width, height, frames }) {
  mkdirSync(folder, { recursive: true });
  const digits = digitsOf(frames);
  let frame = 0;
  return {
    async write(bytes) {
      writeWhole(join(folder, frameName(frame++, digits)), encodePng(bytes, width, height));
    },
    async finish() {},
    async abort() {},
  };
}

async function video(options) {
  checkFiles(options);
  const views = options.path === undefined ? undefined : readViews(options.path);
  const scene = await openMovingScene(options.scene);
  const cloud = await scene.splats(0);
  sayWarnings(options.scene, cloud);
  const { width, height, frameRate } = options;
  const cameras = camerasAlong({ ...options, views, bounds: scene.bounds });
  if (cameras.length > MAX_FRAMES)
    throw new UsageError(`--seconds: expected at most ${MAX_FRAMES} frames, found ${cameras.length}`);
  const target = resolve(options.out);
  if (!isVideo(target)) checkFrames(target, cameras.length);
  const renderer = await openSceneRenderer(cloud, options.drawing);
  const open = isVideo(target) ? openVideo : openFolder;
  const isOpaque = options.drawing.background[3] === 1;
  const output = open(target, { width, height, frameRate, isOpaque, frames: cameras.length });
  try {
    for (const [frame, camera] of cameras.entries()) {
      await renderer.show(await scene.splats(frame / frameRate));
      await output.write(toBytes(await renderer.draw(camera)));
    }
    await output.finish();
  } catch (error) {
    await output.abort();
    throw error;
  }
  report({ splats: cloud.count });
  console.log(
    `${options.out}: ${cameras.length} frames of ${width}x${height}, ${+(cameras.length / frameRate).toFixed(2)} s; ` +
      `${cloud.count} splats by ${renderer.viewpoint.rasterizer} in ${renderer.accumulation} on ${renderer.adapterName}`,
  );
}

await runCommand(USAGE, parseOptions, video, {
  name: 'video',
  endings: ['.webm', '.mp4'],
  accepts: (path, isScene) => isScene(path) || isClip(path),
});
