/** Splats follow the scene graph of three.js, also through transforms that have no inverse. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { PerspectiveCamera, Scene } from 'three/webgpu';
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { SplatScene } from '../../packages/three/src/splat-scene.js';
import { SplatWorld } from '../../packages/three/src/splat-world.js';
import { cloudOf } from '../support/clouds.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';

after(endNodeDevice);

test('an object of scale 0 shows nothing, as meshes do, and appears again with another scale', async () => {
  const device = await serialDevice();
  const cloud = cloudOf([{ position: [0, 0, 0], scale: 1, opacity: 1, color: [1, 1, 1] }]);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const splats = new SplatScene(gaussians);
  const scene = new Scene().add(splats);
  const camera = new PerspectiveCamera(60, 1, 0.1, 100);
  const world = new SplatWorld(device, {}, () => undefined);
  const isEmptyAt = (x: number, y = x, z = x): boolean => {
    splats.scale.set(x, y, z);
    scene.updateWorldMatrix(true, true);
    world.follow(scene, camera);
    return world.isEmpty;
  };
  assert.equal(isEmptyAt(1), false);
  assert.equal(isEmptyAt(0), true);
  assert.equal(isEmptyAt(-2), false);
  assert.equal(isEmptyAt(1, 0, 1), true);
  assert.equal(isEmptyAt(NaN), true);
  assert.equal(isEmptyAt(0.01), false);
  world.viewpoint.destroy();
  gaussians.destroy();
});
