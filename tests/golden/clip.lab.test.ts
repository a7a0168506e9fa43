/** Frames of clips, made on the GPU, against the same frames made on the CPU and packed. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import { viewsAround } from '@gaussian-splat/economise';
import {
  clipFrame,
  clipGroupAt,
  LoadBudget,
  parseClip,
  readClipPart,
  type ClipPartContent,
} from '@gaussian-splat/formats';
import { AnimatedGaussians, GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { packAnimation, type PackedAnimation } from '@gaussian-splat/renderer/tools';
import { clipOf } from '../support/clips.js';
import { psnr } from '../support/metrics.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { fountain } from '../support/scenes/fountain.js';
import { capture, Renderer } from '../support/renderer.js';

const LIMIT_DB = 59;
const FRAMES = 16;
after(endNodeDevice);

const sources = fountain({ splats: 1_500, frames: FRAMES, framesPerSecond: 10 });
const { bytes } = await clipOf(sources, { frames: FRAMES, framesPerGroup: 8 });
const index = parseClip(bytes, 'a.gsv');

const read = (group: number): Promise<ClipPartContent[]> =>
  Promise.all(
    index.groups[group].parts.map((part) =>
      readClipPart({
        shDegree: index.shDegree,
        bytes: bytes.subarray(part.start, part.start + part.sceneBytes + part.motionBytes),
        ...{ part, frames: index.groups[group].frames, name: 'a.gsv' },
      }),
    ),
  );
const packed = (parts: readonly ClipPartContent[]): PackedAnimation[] =>
  parts.map(({ cloud, motion }) => packAnimation(cloud, motion, index.origin));

const room = index.groups[0].parts.map((_, k) => {
  const max = (of: (part: (typeof index.groups)[0]['parts'][0]) => number): number =>
    Math.max(...index.groups.map(({ parts }) => of(parts[k])));
  return { rows: max(({ splats }) => splats), planes: max(({ planes }) => planes), frames: 8 };
});

const [camera] = viewsAround(index.bounds, 1, { width: 256, height: 192 });

test('frames are those that the CPU makes; a frame without its fine part is the coarse one, enlarged', async () => {
  const device = await serialDevice();
  const gaussians = await AnimatedGaussians.create(device, { ...index, parts: room, grow: 1.5 });
  const renderer = new Renderer(device);
  const drawn = (scene: AnimatedGaussians | GaussianBuffers): Promise<Float32Array> =>
    capture(device, renderer, { gaussians: scene, camera, settings: { quality: 'reference' } });
  const ofCloud = async (cloud: GaussianCloud): Promise<Float32Array> => {
    const buffers = await GaussianBuffers.upload(device, packGaussians(cloud, { sh: 'float16' }));
    const image = await drawn(buffers);
    buffers.destroy();
    return image;
  };
  const groups = [await read(0), await read(1)];
  const contents = groups.map(packed);
  for (const [group, own] of contents.entries()) own.forEach((part, k) => gaussians.write(group, k, part));
  const bytesBefore = gaussians.byteLength;
  for (const frame of [0, 3, 7, 8, 15, 2]) {
    const group = clipGroupAt(index, frame);
    const ownFrame = frame - index.groups[group].first;
    gaussians.show(group, ownFrame, true);
    const expected = await ofCloud(clipFrame(groups[group], ownFrame, 'a.gsv', new LoadBudget(1 << 24)));
    const found = psnr(await drawn(gaussians), expected);
    assert.ok(found >= LIMIT_DB, `frame ${frame}: ${found.toFixed(1)} dB`);
  }
  assert.equal(gaussians.byteLength, bytesBefore);

  // In pieces, as a page uploads it.
  gaussians.clear(0);
  gaussians.write(0, 0, contents[1][0]);
  assert.equal(gaussians.write(0, 1, contents[1][1], 1000), 1000);
  assert.ok(gaussians.isWritten(0, 0) && !gaussians.isWritten(0, 1));
  gaussians.show(0, 4, false);
  const coarse = clipFrame([groups[1][0]], 4, 'a.gsv', new LoadBudget(1 << 24));
  const grown = { ...coarse, scales: coarse.scales.map((value) => 1.5 * value) };
  const found = psnr(await drawn(gaussians), await ofCloud(grown));
  assert.ok(found >= LIMIT_DB, `coarse: ${found.toFixed(1)} dB`);
  while (!gaussians.isWritten(0, 1)) gaussians.write(0, 1, contents[1][1], 5000);
  gaussians.show(0, 4, true);
  const whole = psnr(await drawn(gaussians), await ofCloud(clipFrame(groups[1], 4, 'a.gsv', new LoadBudget(1 << 24))));
  assert.ok(whole >= LIMIT_DB, `whole: ${whole.toFixed(1)} dB`);
  assert.ok(boundsOf(coarse).radius > 0);
  renderer.destroy();
  gaussians.destroy();
});
