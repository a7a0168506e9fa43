import type { Camera } from '@gaussian-splat/core';
import type { StreamedGaussians } from '@gaussian-splat/renderer';
import { anyDevice } from './node-device.js';
import type { Renderer } from './renderer.js';

/** Successive frames without new pages, and the upper limit of frames. */
const CALM = 10;
const MAX_FRAMES = 3000;

/** Draws a streamed scene until nothing more comes. */
export async function drawUntilCalm(
  scene: StreamedGaussians,
  renderer: Renderer,
  camera: Camera,
  detail: number,
): Promise<void> {
  const device = await anyDevice();
  const target = device.createTexture({ size: [camera.width, camera.height], format: 'rgba8unorm', usage: 0x10 });
  for (let [calm, frames] = [0, 0]; calm < CALM && frames < MAX_FRAMES; frames++) {
    const { resident } = scene.progress;
    renderer.render({ gaussians: scene, camera, target, detail });
    await device.queue.onSubmittedWorkDone();
    await new Promise((resolve) => setTimeout(resolve, 2));
    calm = scene.progress.resident === resident && scene.progress.coming === 0 ? calm + 1 : 0;
  }
  target.destroy();
}
