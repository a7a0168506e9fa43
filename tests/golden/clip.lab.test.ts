/** Frames of clips, made on the GPU, against the same frames made on the CPU and packed. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import { viewsAround } from '@gaussian-splat/optimize';
import {
  clipFrame,
  clipGroupAt,
  LoadBudget,
  parseClip,
  readClipPart,
  type ClipIndex,
  type ClipPart,
  type ClipPartContent,
} from '@gaussian-splat/formats';
import {
  AnimatedGaussians,
  GaussianBuffers,
  packGaussians,
  STILL_SLOT,
  type AnimatedRoom,
} from '@gaussian-splat/renderer';
import { packAnimation, type PackedAnimation } from '@gaussian-splat/renderer/tools';
import { clipOf } from '../support/clips.js';
import { psnr } from '../support/metrics.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { fountain } from '../support/scenes/fountain.js';
import { turningBall } from '../support/scenes/turning-ball.js';
import { capture, Renderer } from '../support/renderer.js';

const LIMIT_DB = 59;
const FRAMES = 16;
after(endNodeDevice);

/** A clip as the renderer gets it. */
async function opened(frameOf: (frame: number) => GaussianCloud): Promise<Opened> {
  const { bytes } = await clipOf(frameOf, { frames: FRAMES, framesPerGroup: 8 });
  const index = parseClip(bytes, 'a.gsv');
  const read = (parts: readonly ClipPart[], frames: number): Promise<ClipPartContent[]> =>
    Promise.all(
      parts.map((part) =>
        readClipPart({
          bytes: bytes.subarray(part.start, part.start + part.sceneBytes + part.motionBytes),
          ...{ part, frames, shDegree: index.shDegree, name: 'a.gsv' },
        }),
      ),
    );
  const roomOf = (part: ClipPart, frames: number): AnimatedRoom['parts'][0] => ({
    ...{ rows: part.splats, planes: part.planes, frames },
  });
  const parts = index.groups[0].parts.map((_, k) => {
    const max = (of: (part: ClipPart) => number): number => Math.max(...index.groups.map((own) => of(own.parts[k])));
    return { rows: max(({ splats }) => splats), planes: max(({ planes }) => planes), frames: 8 };
  });
  return {
    index,
    still: await read(index.still, 1),
    groups: await Promise.all(index.groups.map((own) => read(own.parts, own.frames))),
    room: { ...index, parts, still: index.still.map((part) => roomOf(part, 1)) },
  };
}

interface Opened {
  readonly index: ClipIndex;
  readonly still: readonly ClipPartContent[];
  readonly groups: readonly (readonly ClipPartContent[])[];
  readonly room: AnimatedRoom;
}

const { index, still, groups, room } = await opened(fountain({ splats: 1_500, frames: FRAMES, framesPerSecond: 10 }));
const packedOf = (parts: readonly ClipPartContent[], origin: ClipIndex['origin']): PackedAnimation[] =>
  parts.map(({ cloud, motion }) => packAnimation(cloud, motion, origin));
const shownIn = (own: Opened, group: number, frame: number): GaussianCloud =>
  clipFrame([...own.still, ...own.groups[group]], frame, 'a.gsv', new LoadBudget(1 << 24));

const [camera] = viewsAround(index.bounds, 1, { width: 256, height: 192 });

/** Draws scenes and clouds for comparison. */
function studio(device: GPUDevice): {
  readonly drawn: (scene: AnimatedGaussians | GaussianBuffers) => Promise<Float32Array>;
  readonly ofCloud: (cloud: GaussianCloud) => Promise<Float32Array>;
  readonly renderer: Renderer;
} {
  const renderer = new Renderer(device);
  const drawn = (scene: AnimatedGaussians | GaussianBuffers): Promise<Float32Array> =>
    capture(device, renderer, { gaussians: scene, camera, settings: { quality: 'reference' } });
  const ofCloud = async (cloud: GaussianCloud): Promise<Float32Array> => {
    const buffers = await GaussianBuffers.upload(device, packGaussians(cloud, { sh: 'float16' }));
    const image = await drawn(buffers);
    buffers.destroy();
    return image;
  };
  return { drawn, ofCloud, renderer };
}

test('frames are those that the CPU makes; a frame without its fine part is the coarse one, enlarged', async () => {
  const device = await serialDevice();
  assert.ok(still.length === 2 && groups.flat().some(({ motion }) => motion.parts.position.aged > 0));
  const gaussians = await AnimatedGaussians.create(device, { ...room, grow: 1.5 });
  const { drawn, ofCloud, renderer } = studio(device);
  const own = { index, still, groups, room };
  const contents = groups.map((parts) => packedOf(parts, index.origin));
  for (const [group, parts] of contents.entries()) parts.forEach((part, k) => gaussians.write(group, k, part));
  packedOf(still, index.origin).forEach((part, k) => gaussians.write(STILL_SLOT, k, part));
  const bytesBefore = gaussians.byteLength;
  for (const frame of [0, 3, 7, 8, 15, 2]) {
    const group = clipGroupAt(index, frame);
    const ownFrame = frame - index.groups[group].first;
    gaussians.show(group, ownFrame, true);
    const found = psnr(await drawn(gaussians), await ofCloud(shownIn(own, group, ownFrame)));
    assert.ok(found >= LIMIT_DB, `frame ${frame}: ${found.toFixed(1)} dB`);
  }
  assert.equal(gaussians.byteLength, bytesBefore);

  // In pieces, as a page uploads it.
  gaussians.clear(0);
  gaussians.write(0, 0, contents[1][0]);
  assert.equal(gaussians.write(0, 1, contents[1][1], 1000), 1000);
  assert.ok(gaussians.isWritten(0, 0) && !gaussians.isWritten(0, 1));
  gaussians.show(0, 4, false);
  const coarse = clipFrame([...still, groups[1][0]], 4, 'a.gsv', new LoadBudget(1 << 24));
  const grown = { ...coarse, scales: coarse.scales.map((value) => 1.5 * value) };
  const found = psnr(await drawn(gaussians), await ofCloud(grown));
  assert.ok(found >= LIMIT_DB, `coarse: ${found.toFixed(1)} dB`);
  while (!gaussians.isWritten(0, 1)) gaussians.write(0, 1, contents[1][1], 5000);
  gaussians.show(0, 4, true);
  const whole = psnr(await drawn(gaussians), await ofCloud(shownIn(own, 1, 4)));
  assert.ok(whole >= LIMIT_DB, `whole: ${whole.toFixed(1)} dB`);
  assert.ok(boundsOf(coarse).radius > 0);
  renderer.destroy();
  gaussians.destroy();
});

test('harmonics of each degree turn with their splats as on the CPU', async () => {
  const device = await serialDevice();
  const { drawn, ofCloud, renderer } = studio(device);
  for (const degree of [1, 2, 3] as const) {
    const own = await opened((frame) => turningBall({ degree, frame, splats: 150, degrees: 9 }));
    assert.ok(own.groups.flat().every(({ motion }) => motion.turnsHarmonics));
    const gaussians = await AnimatedGaussians.create(device, own.room);
    for (const [group, parts] of own.groups.entries())
      packedOf(parts, own.index.origin).forEach((part, k) => gaussians.write(group, k, part));
    for (const [group, frame] of [
      [0, 0],
      [0, 5],
      [1, 7],
    ]) {
      gaussians.show(group, frame, true);
      const found = psnr(await drawn(gaussians), await ofCloud(shownIn(own, group, frame)));
      assert.ok(found >= LIMIT_DB, `degree ${degree}, frame ${frame} of group ${group}: ${found.toFixed(1)} dB`);
    }
    gaussians.destroy();
  }
  renderer.destroy();
});
