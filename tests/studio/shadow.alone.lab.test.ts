/** Shadows of subjects that are cut out of trained scenes, against those of their meshes. docs/accuracy.md has the figures. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { boundsOf, type Camera, type Vector3 } from '@gaussian-splat/core';
import { capture, GaussianBuffers, packGaussians, Viewpoint, World } from '@gaussian-splat/renderer';
import {
  SHADOW_PIXELS,
  shadowSplats,
  takeShadow,
  toViewer,
  type Subject,
  type TakeAlpha,
} from '../support/element/shadow.js';
import { anyDevice, endNodeDevice } from '../support/node-device.js';
import { trianglesOf } from '../support/studio-floor.js';
import { seenAt } from '../support/studio-geometry.js';
import { studio } from '../support/studio.js';

/** Subjects, by the names of their objects. */
const SUBJECTS = {
  apartment: /^dining table$/,
  hall: /^(statue|pedestal)$/,
  product: /^arm /,
  walker: /^person$/,
} as const;
/** Meters between the subject and the walls of the cut, and between the ground and its bottom. */
const [BESIDE, ABOVE] = [0.1, 0.02];
/** y up, z towards the viewer. */
const FRAME = [[1, 0, 0], [0, -1, 0], [0, 0, -1]] as const; // prettier-ignore

/** Opacity of triangles, at points that are less than half a pixel apart. */
const meshAlpha =
  (triangles: readonly (readonly Vector3[])[]): TakeAlpha =>
  (camera: Camera) => {
    const alpha = new Float32Array(SHADOW_PIXELS * SHADOW_PIXELS);
    for (const [a, b, c] of triangles) {
      const [p, q, r] = [a, b, c].map((corner) => seenAt(camera, corner));
      const side = Math.max(...[q, r].map((other) => Math.hypot(other.x - p.x, other.y - p.y)));
      const steps = Math.ceil(2 * side) + 1;
      for (let i = 0; i <= steps; i++)
        for (let j = 0; j <= steps - i; j++) {
          const [u, v] = [i / steps, j / steps];
          const at = seenAt(camera, [0, 1, 2].map((k) => a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k])) as never as Vector3); // prettier-ignore
          const [x, y] = [Math.floor(at.x), Math.floor(at.y)];
          const isInside = x >= 0 && y >= 0 && x < SHADOW_PIXELS && y < SHADOW_PIXELS;
          if (isInside && at.depth >= camera.near && at.depth <= camera.far!) alpha[y * SHADOW_PIXELS + x] = 1;
        }
    }
    return alpha;
  };

/** Ground of a shadow in meters, its middle, and its darkness: the sum of opacities in square meters. */
async function shadowOf(subject: Subject, take: TakeAlpha) {
  const map = await takeShadow(subject, take);
  assert.ok(map, 'a visible subject');
  const rows = shadowSplats(map, 1, 1).map(([place, , [, , , code]]) => ({ place, code }));
  const sum = rows.reduce((total, { code }) => total + code, 0);
  const at = [0, 2].map(
    (k) => map.middle[k] + (map.half * rows.reduce((total, { place, code }) => total + place[k] * code, 0)) / sum,
  );
  return { ground: map.middle[1], at, sum, pixel: (2 * map.half) / SHADOW_PIXELS };
}

for (const [name, objects] of Object.entries(SUBJECTS) as [keyof typeof SUBJECTS, RegExp][])
  test(`${name}: the shadow of a subject is that of its mesh`, async () => {
    const device = await anyDevice();
    const { cloud } = await studio(name);
    const bounds = boundsOf(cloud);
    const { center, radius } = bounds.subject ?? bounds;
    const subject = { center: toViewer(FRAME, center), radius, frame: FRAME };
    const triangles = [...trianglesOf(name, (object) => objects.test(object))].map((each) =>
      each.map(([x, y, z]): Vector3 => [x, -y, -z]),
    );
    const ends = [Math.min, Math.max].map((end) =>
      [0, 1, 2].map((k) =>
        triangles.flat().reduce((found, point) => end(found, point[k]), end === Math.min ? Infinity : -Infinity),
      ),
    );
    const [low, high] = ends;
    const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
    const world = new World();
    const crop = {
      min: low.map((value) => value - BESIDE) as never as Vector3,
      max: [high[0] + BESIDE, high[1] - ABOVE, high[2] + BESIDE] as Vector3,
    };
    world.add({ scene: gaussians, crop });
    const viewpoint = new Viewpoint(device, world, { settings: { shDegree: 0 } });
    const found = await shadowOf(subject, async (camera) => {
      const pixels = await capture(device, viewpoint, { camera });
      return Float32Array.from({ length: SHADOW_PIXELS ** 2 }, (_, i) => pixels[4 * i + 3]);
    });
    const truth = await shadowOf(subject, meshAlpha(triangles));
    const beside = Math.hypot(found.at[0] - truth.at[0], found.at[1] - truth.at[1]);
    const [above, aside, pixel] = [found.ground + high[1], beside, found.pixel].map((m) => (100 * m).toFixed(1));
    console.log(
      `${name} ${objects}: ${above} cm above the floor, its middle ${aside} cm from that of the mesh, ${(found.sum / truth.sum).toFixed(2)} times as dark; pixels of ${pixel} cm`,
    );
    assert.ok(Math.abs(found.ground + high[1]) < 0.12, `ground ${above} cm off`);
    assert.ok(beside < 0.06, `middle ${aside} cm off`);
    assert.ok(Math.abs(Math.log2(found.sum / truth.sum)) < 0.6, `${found.sum / truth.sum} times as dark`);
    [viewpoint, gaussians].forEach((owner) => owner.destroy());
  });

after(endNodeDevice);
