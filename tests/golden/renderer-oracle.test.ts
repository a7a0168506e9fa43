/** The default image, in float before rounding, against the float64 oracle: real captures and procedural scenes. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import type { Mode } from '../oracle/oracle.js';
import { referenceViews } from '../support/cameras.js';
import { compareWithOracle, describeCloseness } from '../support/compare.js';
import { hasSharedData, needsSharedData, sharedFile } from '../support/data.js';
import { isFull, isLab, someOf } from '../support/extent.js';
import { limitOn, type Limit } from '../support/limit.js';
import { endNodeDevice, anyDevice } from '../support/node-device.js';
import { proceduralScenes, resized } from '../support/scenes.js';

const MODES: readonly Mode[] = ['classic', 'antialiased'];
/** dB that the default image must reach in its worst view. */
const LIMIT_DB = 59;
/** 99.9 % of the channels are at most this far off. */
const LIMIT_P999 = 1 / 255;
/**
 * The same for colors up to 4, at which a step of float16 is four times one at 1. Rounding of blends in float16 depends on the adapter: 0.93/255 on SwiftShader; an NVIDIA H200, which also rounds the source colors, has 1.11.
 */
const LIMIT_P999_BRIGHT: Limit = { swiftshader: 1 / 255, hardware: 1.25 / 255 };

async function assertClose(
  name: string,
  scene: GaussianCloud,
  camera: Camera,
  mode: Mode,
  p999 = LIMIT_P999,
): Promise<void> {
  const closeness = await compareWithOracle(await anyDevice(), scene, camera, mode);
  console.log(describeCloseness(name, closeness));
  assert.ok(closeness.psnr >= LIMIT_DB, `${name}: ${closeness.psnr} dB`);
  assert.ok(closeness.p999 <= p999, `${name}: 99.9th percentile ${255 * closeness.p999}/255`);
}

if (!hasSharedData) {
  test('reference views', { skip: needsSharedData }, () => undefined);
} else {
  const clouds = new Map<string, ReturnType<typeof readScene>>();
  for (const [i, view] of someOf(referenceViews(), 1).entries()) {
    for (const mode of isFull ? MODES : [MODES[i % 2]]) {
      test(`${view.name}, ${mode}`, async () => {
        if (!clouds.has(view.file)) clouds.set(view.file, readScene(sharedFile(view.file), { name: view.file }));
        const cloud = await clouds.get(view.file)!;
        await assertClose(`${view.name} ${mode}`, cloud, view.camera, mode);
      });
    }
  }
}

for (const [i, makeScene] of proceduralScenes.entries()) {
  for (const mode of isLab ? MODES : [MODES[i % 2]]) {
    test(`${makeScene.name}, ${mode}`, async () => {
      const { name, cloud, cameras } = makeScene();
      const p999 = name === 'brightColors' ? limitOn(await anyDevice(), LIMIT_P999_BRIGHT) : LIMIT_P999;
      for (const [k, camera] of someOf(cameras, 1).entries()) {
        const own = isLab ? camera : resized(camera, Math.round(camera.width / 1.5));
        await assertClose(`${name} ${k} ${mode}`, cloud, own, mode, p999);
      }
    });
  }
}

after(endNodeDevice);
