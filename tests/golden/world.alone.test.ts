/** Several scenes in one image, against the float64 oracle: placed by any affine matrix, faded, cropped, and hidden by a host's meshes. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { lookAt, multiply, type Camera, type GaussianCloud, type Matrix4 } from '@gaussian-splat/core';
import {
  capture,
  GaussianBuffers,
  packGaussians,
  SceneDepth,
  settings,
  Viewpoint,
  World,
  type GaussianScene,
  type HostDepth,
  type RasterizerName,
} from '@gaussian-splat/renderer';
import { boundsOfWorld } from '@gaussian-splat/renderer/tools';
import { renderOracleWorld, type PlacedCloud } from '../oracle/oracle.js';
import { closeness } from '../support/compare.js';
import { isLab, onlyInLab, someOf } from '../support/extent.js';
import { psnr } from '../support/metrics.js';
import { countWork } from '../support/work-counters.js';
import { randomSource } from '../support/gpu.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';
import { readTexture } from '../support/read-frame.js';
import { cameraAt } from '../support/scenes.js';
import { UP } from '../support/scenes/scene.js';

after(endNodeDevice);

const RASTERIZERS: readonly RasterizerName[] = ['quads', 'tiles'];

/** Leaning ellipsoids around the origin, with harmonics of degree 3. */
function blobs(count: number, seed: number, antialiased: boolean): GaussianCloud {
  const random = randomSource(seed);
  const fill = (length: number, value: (i: number) => number): Float32Array =>
    Float32Array.from({ length }, (_, i) => value(i));
  const rotations = fill(4 * count, () => random() - 0.5);
  for (let i = 0; i < rotations.length; i += 4) {
    const norm = Math.hypot(...rotations.subarray(i, i + 4));
    for (let k = 0; k < 4; k++) rotations[i + k] /= norm;
  }
  return {
    count,
    shDegree: 3,
    antialiased,
    origin: [0, 0, 0],
    droppedCount: 0,
    positions: fill(3 * count, () => 2 * (random() - 0.5)),
    scales: fill(3 * count, () => 0.02 + 0.12 * random()),
    rotations,
    opacities: fill(count, () => 0.1 + 0.85 * random()),
    sh: fill(48 * count, (i) => (i % 48 < 3 ? 1.6 : 0.3) * (random() - 0.5)),
  };
}

const clouds = [blobs(700, 5, false), blobs(700, 6, true)] as const;

const turn = (angle: number): Matrix4 => {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0, 0, 0, 0, 1];
};
const move = (x: number, y: number, z: number): Matrix4 => [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1];
const stretch = (x: number, y = x, z = x): Matrix4 => [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];
const SHEAR: Matrix4 = [1, 0.6, 0, 0, 0, 1, 0.3, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const all = (...matrices: Matrix4[]): Matrix4 => matrices.reduce((a, b) => multiply(a, b));

/** Size of images, over that of the laboratory. */
const SCALE = isLab ? 1 : 2 / 3;

/** A view of everything within `size` of the origin. */
function view(size = 1): Camera {
  const options = { width: 144 * SCALE, height: 96 * SCALE, near: 0.2 };
  const camera = cameraAt([2.2, -1.1, -3.4], [0.2, 0, 0], options);
  const eye = [2.2 * size, -1.1 * size, -3.4 * size] as const;
  return { ...camera, near: 0.2 * size, worldToCamera: lookAt(eye, [0.2 * size, 0, 0], UP) };
}

interface Case {
  readonly name: string;
  readonly size?: number;
  readonly placed: readonly Omit<PlacedCloud, 'cloud' | 'mode'>[];
  readonly camera?: Camera;
}

const flat = { fx: 40 * SCALE, fy: 40 * SCALE, cx: 70 * SCALE, cy: 50 * SCALE };
const orthographic: Camera = { ...view(), orthographic: true, ...flat };

const CASES: readonly Case[] = [
  { name: 'rotated', placed: [{}, { sceneToWorld: all(move(0.8, 0.1, 0.4), turn(2.1)) }] },
  {
    name: 'a thousandth as large',
    size: 1e-3,
    placed: [{ sceneToWorld: stretch(1e-3) }, { sceneToWorld: all(move(4e-4, 0, 0), turn(1), stretch(8e-4)) }],
  },
  {
    name: 'a thousand times as large',
    size: 1e3,
    placed: [{ sceneToWorld: stretch(1e3) }, { sceneToWorld: all(move(400, 0, 0), turn(1), stretch(800)) }],
  },
  {
    name: 'mirrored',
    placed: [{ sceneToWorld: stretch(-1, 1, 1) }, { sceneToWorld: all(turn(0.5), stretch(1, -0.7, 1)) }],
  },
  {
    name: 'sheared',
    placed: [{ sceneToWorld: SHEAR }, { sceneToWorld: all(SHEAR, turn(0.7), stretch(0.5, 1.2, 0.8)) }],
  },
  {
    name: 'faded and cropped',
    placed: [
      { opacity: 0.4, crop: { min: [-0.6, -1, -1], max: [1, 0.5, 1] } },
      { sceneToWorld: turn(1.3), opacity: 0.7 },
    ],
  },
  { name: 'by parallel rays', placed: [{}, { sceneToWorld: all(SHEAR, turn(2)) }], camera: orthographic },
];

async function worldOf(device: GPUDevice, placed: readonly Omit<PlacedCloud, 'cloud' | 'mode'>[]) {
  const world = new World();
  const buffers = await Promise.all(
    placed.map((_, i) => GaussianBuffers.upload(device, packGaussians(clouds[i], { sh: 'float16' }))),
  );
  placed.forEach((each, i) => world.add({ ...each, scene: buffers[i] }));
  return { world, free: () => buffers.forEach((each) => each.destroy()) };
}

const asClouds = (placed: Case['placed']): PlacedCloud[] =>
  placed.map((each, i) => ({ ...each, cloud: clouds[i], mode: clouds[i].antialiased ? 'antialiased' : 'classic' }));

// Matrices mean the same to both, and SwiftShader compiles tiles for seconds.
for (const rasterizer of someOf(RASTERIZERS, 1)) {
  for (const { name, size, placed, camera = view(size) } of someOf(CASES, 3)) {
    test(`${rasterizer}: two scenes, ${name}: 59 dB against the oracle`, async () => {
      const device = await serialDevice();
      const { world, free } = await worldOf(device, placed);
      const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer }) });
      const pixels = await capture(device, viewpoint, { camera });
      const { psnr } = closeness(pixels, renderOracleWorld(asClouds(placed), camera, { rules: 'gsplat' }));
      console.log(`${rasterizer}, ${name}: ${psnr.toFixed(1)} dB`);
      assert.ok(psnr >= 59, `${psnr} dB`);
      viewpoint.destroy();
      free();
    });
  }
}

/** A bar that leans through the scene: its camera depth, Infinity beside it. */
function barDepth({ width, height, fx, cx, cy, orthographic: isFlat }: Camera): Float64Array {
  return Float64Array.from({ length: width * height }, (_, i) => {
    const [x, y] = [(i % width) + 0.5 - cx, Math.floor(i / width) + 0.5 - cy];
    if (Math.abs(y - 0.2 * x) > 14 * SCALE) return Infinity;
    // The plane z = 4 + 0.8 x.
    const slope = 0.8 / fx;
    return isFlat ? 4 + slope * x : 4 / (1 - slope * x);
  });
}

const [NEAR, FAR] = [0.5, 40];

/** Values that a GPU would store. */
function stored(
  depth: number,
  { reversed, isFlat, far = FAR }: { reversed: boolean; isFlat: boolean; far?: number },
): number {
  if (depth === Infinity) return reversed ? 0 : 1;
  const share = isFlat
    ? (depth - NEAR) / (far - NEAR)
    : (1 / NEAR - 1 / depth) / (1 / NEAR - (far === Infinity ? 0 : 1 / far));
  return reversed ? 1 - share : share;
}

/** Writes numbers into a depth texture as a host does: by drawing. */
function depthTexture(device: GPUDevice, format: GPUTextureFormat, values: Float32Array, width: number): GPUTexture {
  const height = values.length / width;
  const source = device.createTexture({ size: [width, height], format: 'r32float', usage: 6 });
  device.queue.writeTexture({ texture: source }, values, { bytesPerRow: 4 * width }, [width, height]);
  if (format === 'r32float') return source;
  const texture = device.createTexture({ size: [width, height], format, usage: 0x14 });
  const module = device.createShaderModule({
    code: `@group(0) @binding(0) var source: texture_2d<f32>;
      @vertex fn v(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0); }
      @fragment fn f(@builtin(position) p: vec4f) -> @builtin(frag_depth) f32 { return textureLoad(source, vec2u(p.xy), 0).r; }`,
  });
  const layout = device.createBindGroupLayout({
    entries: [{ binding: 0, visibility: 2, texture: { sampleType: 'unfilterable-float' } }],
  });
  const pipeline = device.createRenderPipeline({
    layout: device.createPipelineLayout({ bindGroupLayouts: [layout] }),
    vertex: { module },
    fragment: { module, targets: [] },
    depthStencil: { format, depthWriteEnabled: true, depthCompare: 'always' },
  });
  const encoder = device.createCommandEncoder();
  const pass = encoder.beginRenderPass({
    colorAttachments: [],
    depthStencilAttachment: {
      view: texture.createView(),
      depthLoadOp: 'clear',
      depthClearValue: 0,
      depthStoreOp: 'store',
    },
  });
  pass.setPipeline(pipeline);
  pass.setBindGroup(0, device.createBindGroup({ layout, entries: [{ binding: 0, resource: source.createView() }] }));
  pass.draw(3);
  pass.end();
  device.queue.submit([encoder.finish()]);
  return texture;
}

type Variant = Omit<HostDepth, 'texture'> & { readonly format: GPUTextureFormat; readonly isFlat?: boolean };

const VARIANTS: readonly Variant[] = [
  { format: 'r32float' },
  { format: 'depth32float', near: NEAR, far: FAR },
  { format: 'depth32float', near: NEAR, far: FAR, reversed: true },
  { format: 'depth32float', near: NEAR, far: Infinity, reversed: true },
  { format: 'depth24plus', near: NEAR, far: FAR },
  { format: 'r32float', values: 'device', near: NEAR, far: FAR, reversed: true },
  { format: 'depth32float', near: NEAR, far: FAR, isFlat: true },
  { format: 'depth32float', near: NEAR, far: FAR, reversed: true, isFlat: true },
];

const placedPair: Case['placed'] = [{}, { sceneToWorld: all(move(0.8, 0.1, 0.4), turn(2.1)) }];

for (const rasterizer of RASTERIZERS) {
  const skip = rasterizer === 'tiles' && onlyInLab;
  test(
    `${rasterizer}: a bar through two scenes occludes what is behind it, for any depth format`,
    { skip },
    async () => {
      const device = await serialDevice();
      const { world, free } = await worldOf(device, placedPair);
      const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer }) });
      // The meaning of a depth does not depend on the rasterizer.
      const stores = someOf(VARIANTS, 2);
      for (const { format, isFlat = false, ...host } of stores) {
        const camera = isFlat ? orthographic : view();
        const bar = barDepth(camera);
        const isDevice = format !== 'r32float' || host.values === 'device';
        const values = Float32Array.from(bar, (depth) =>
          isDevice
            ? stored(depth, { reversed: host.reversed ?? false, isFlat, far: host.far })
            : depth === Infinity
              ? 0
              : depth,
        );
        const texture = depthTexture(device, format, values, camera.width);
        const depth = new SceneDepth(device, { host: { ...host, texture } });
        const oracle = renderOracleWorld(asClouds(placedPair), camera, { rules: 'gsplat', depth: bar });
        // The second frame has an order of all splats, the first one after a turn is sorted.
        for (const each of [camera, { ...camera, worldToCamera: multiply(turn(1e-3), camera.worldToCamera) }, camera]) {
          const pixels = await capture(device, viewpoint, { camera: each, depth });
          if (each !== camera) continue;
          const { psnr } = closeness(pixels, oracle);
          console.log(`${rasterizer}, ${JSON.stringify({ format, isFlat, ...host })}: ${psnr.toFixed(1)} dB`);
          assert.ok(psnr >= 59, `${format}: ${psnr} dB`);
          const whole = renderOracleWorld(asClouds(placedPair), camera, { rules: 'gsplat' });
          assert.ok(closeness(pixels, whole).psnr < 35, 'the bar hides much');
        }
        depth.destroy();
        texture.destroy();
      }
      const plain = await capture(device, viewpoint, { camera: view() });
      const fresh = new Viewpoint(device, world, { settings: settings('default', { rasterizer }) });
      assert.deepEqual(plain, await capture(device, fresh, { camera: view() }), 'frames without depth are as before');
      fresh.destroy();
      viewpoint.destroy();
      free();
    },
  );
}

test('the median depth is that of the oracle', async () => {
  const device = await serialDevice();
  const { world, free } = await worldOf(device, placedPair);
  const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer: 'tiles' }) });
  const camera = view();
  const [width, height] = [camera.width, camera.height];
  const out = device.createTexture({ size: [width, height], format: 'r32float', usage: 0x9 });
  const depth = new SceneDepth(device, { out });
  await capture(device, viewpoint, { camera, depth });
  const found = await readTexture(device, out);
  const { medianDepth } = renderOracleWorld(asClouds(placedPair), camera, { rules: 'gsplat' });
  const isClose = (value: number, i: number): boolean => {
    return Math.abs(found[i] - value) <= 1e-5 * value;
  };
  const close = medianDepth.reduce((sum, value, i) => sum + +isClose(value, i), 0);
  assert.ok(medianDepth.some((value) => value > 0));
  // The next splat is drawn if rounding decides about half of the light.
  assert.ok(close >= 0.998 * medianDepth.length, `${close} of ${medianDepth.length}`);
  viewpoint.destroy();
  free();
});

test('no steps on a wall that a plane cuts at 1, 10 and 100 units', async () => {
  const device = await serialDevice();
  for (const distance of someOf([100, 10, 1], 1)) {
    // Balls on a wall that faces the camera askew; the plane faces it straight.
    const columns = 120;
    const count = columns * 8;
    const at = (i: number): number => ((i % columns) / columns - 0.5) * distance;
    const ball = (value: (i: number) => number): Float32Array =>
      Float32Array.from({ length: count }, (_, i) => value(i));
    const cloud: GaussianCloud = {
      ...{ count, shDegree: 0, antialiased: false, origin: [0, 0, 0], droppedCount: 0 },
      positions: Float32Array.from(
        Array.from({ length: count }, (_, i) => [
          at(i),
          (Math.floor(i / columns) - 3.5) * 0.02 * distance,
          distance + 0.004 * at(i),
        ]).flat(),
      ),
      scales: Float32Array.from({ length: 3 * count }, () => 0.004 * distance),
      rotations: Float32Array.from({ length: 4 * count }, (_, i) => (i % 4 === 0 ? 1 : 0)),
      opacities: ball(() => 0.9),
      sh: Float32Array.from({ length: 3 * count }, (_, i) => (i % 3) * 0.5),
    };
    const camera = { ...cameraAt([0, 0, 0], [0, 0, 1], { width: 240, height: 64 }), worldToCamera: move(0, 0, 0) };
    const values = new Float32Array(240 * 64).fill(distance);
    const texture = depthTexture(device, 'r32float', values, 240);
    const depth = new SceneDepth(device, { host: { texture } });
    const scene = await GaussianBuffers.upload(device, packGaussians(cloud));
    for (const rasterizer of RASTERIZERS) {
      const world = new World();
      world.add({ scene });
      const viewpoint = new Viewpoint(device, world, { settings: settings('default', { rasterizer }) });
      const pixels = await capture(device, viewpoint, { camera, depth });
      const oracle = renderOracleWorld([{ cloud, mode: 'classic' }], camera, { rules: 'gsplat', depth: values });
      const { psnr } = closeness(pixels, oracle);
      console.log(`${rasterizer}, a wall at ${distance}: ${psnr.toFixed(1)} dB`);
      assert.ok(psnr >= 59, `${distance}: ${psnr} dB`);
      viewpoint.destroy();
    }
    scene.destroy();
    texture.destroy();
  }
});

test('a frame of one scene that moves is that of a camera that moves the other way', async () => {
  const device = await serialDevice();
  const { world, free } = await worldOf(device, [{}]);
  const viewpoint = new Viewpoint(device, world);
  const camera = view();
  const [placement] = world.placements;
  for (let k = 0; k < 4; k++) {
    placement.sceneToWorld = all(move(0.05 * k, 0, 0), turn(0.1 * k));
    const moved = await capture(device, viewpoint, { camera });
    const { psnr } = closeness(
      moved,
      renderOracleWorld([{ cloud: clouds[0], mode: 'classic', sceneToWorld: placement.sceneToWorld }], camera, {
        rules: 'gsplat',
      }),
    );
    assert.ok(psnr >= 59, `step ${k}: ${psnr} dB`);
  }
  viewpoint.destroy();
  free();
});

test(
  'memory follows what comes: ten scenes, one of them added, moved, hidden, removed',
  { skip: onlyInLab },
  async () => {
    const device = await serialDevice();
    const scenes = await Promise.all(
      Array.from({ length: 10 }, (_, k) =>
        GaussianBuffers.upload(device, packGaussians(blobs(400 + 10 * k, 20 + k, false))),
      ),
    );
    const camera = view();
    const target = device.createTexture({ size: [camera.width, camera.height], format: 'rgba8unorm', usage: 0x10 });
    const counter = countWork(device);
    for (const rasterizer of RASTERIZERS) {
      const how = settings('default', { rasterizer });
      const bytesOf = (some: readonly GaussianBuffers[]): number => {
        const world = new World();
        for (const scene of some) world.add({ scene });
        const viewpoint = new Viewpoint(device, world, { settings: how });
        viewpoint.draw(camera, { target });
        const { byteLength } = viewpoint;
        viewpoint.destroy();
        return byteLength;
      };
      const world = new World();
      const placements = scenes.slice(0, 9).map((scene) => world.add({ scene }));
      const viewpoint = new Viewpoint(device, world, { settings: how });
      const draw = () => {
        counter.take();
        viewpoint.draw(camera, { target });
        return counter.take();
      };
      draw();
      const before = viewpoint.byteLength;
      const last = world.add({ scene: scenes[9] });
      draw();
      const grown = viewpoint.byteLength - before;
      assert.ok(grown <= bytesOf([scenes[9]]), `${rasterizer}: ${grown} bytes for one scene`);
      assert.ok(viewpoint.byteLength <= bytesOf(scenes) + 4096, 'no more than for ten at once');
      draw();
      for (let k = 0; k < 12; k++) {
        placements[3].sceneToWorld = move(0.01 * k, 0, 0);
        const { buffersCreated, bytesAllocated, submits } = draw();
        assert.deepEqual([buffersCreated, bytesAllocated, submits], [0, 0, 1], 'moving allocates nothing');
      }
      const expected = await capture(device, viewpoint, { camera });
      world.remove(placements[0]);
      placements[0] = world.add({ scene: scenes[0] });
      assert.equal(draw().buffersCreated, 0, 'another order allocates nothing');
      last.visible = false;
      assert.equal(draw().buffersCreated, 0, 'a scene that is hidden allocates nothing');
      await capture(device, viewpoint, { camera });
      last.visible = true;
      assert.equal(draw().buffersCreated, 0, 'a scene that comes back finds the room that it left');
      const again = await capture(device, viewpoint, { camera });
      assert.ok(psnr(again, expected) > 90, 'what came back looks as before');
      for (const placement of placements) world.remove(placement);
      draw();
      assert.ok(viewpoint.byteLength <= bytesOf([scenes[9]]) + 16384, 'room is given back');
      const alone = new World();
      alone.add({ scene: scenes[9] });
      const fresh = new Viewpoint(device, alone, { settings: how });
      assert.deepEqual(await capture(device, viewpoint, { camera }), await capture(device, fresh, { camera }));
      fresh.destroy();
      viewpoint.destroy();
    }
    for (const scene of scenes) scene.destroy();
    target.destroy();
  },
);

test('one scene twice, two viewpoints of one world', async () => {
  const device = await serialDevice();
  const { world, free } = await worldOf(device, [{}]);
  const [{ scene }] = world.placements;
  const sceneToWorld = all(move(0.7, 0, 0.5), turn(0.9));
  world.add({ scene, sceneToWorld });
  const [one, other] = [view(), cameraAt([-2, -1, -3], [0, 0, 0], { width: 96, height: 64 })];
  const twice: PlacedCloud[] = [
    { cloud: clouds[0], mode: 'classic' },
    { cloud: clouds[0], mode: 'classic', sceneToWorld },
  ];
  const viewpoints = [
    new Viewpoint(device, world),
    new Viewpoint(device, world, { settings: settings('default', { rasterizer: 'tiles' }) }),
  ];
  for (const camera of [one, other, one]) {
    for (const viewpoint of viewpoints) {
      const { psnr: found } = closeness(
        await capture(device, viewpoint, { camera }),
        renderOracleWorld(twice, camera, { rules: 'gsplat' }),
      );
      assert.ok(found >= 59, `${found} dB`);
    }
  }
  for (const viewpoint of viewpoints) viewpoint.destroy();
  free();
});

test('the opacity of a scene is that of an opaque surface of many splats', async () => {
  const random = randomSource(9);
  const wall = {
    ...blobs(2000, 8, false),
    positions: Float32Array.from({ length: 6000 }, (_, i) => (i % 3 === 2 ? 0.05 : 3) * (random() - 0.5)),
    scales: new Float32Array(6000).fill(0.06),
  };
  const device = await serialDevice();
  const scene = await GaussianBuffers.upload(device, packGaussians(wall));
  const camera = cameraAt([0, 0, -3], [0, 0, 0], { width: 96, height: 64, near: 0.2 });
  const alphas = async (opacity: number): Promise<Float32Array> => {
    const world = new World();
    world.add({ scene, opacity });
    const viewpoint = new Viewpoint(device, world, {});
    const pixels = await capture(device, viewpoint, { camera });
    viewpoint.destroy();
    return pixels.filter((_, i) => i % 4 === 3);
  };
  const whole = await alphas(1);
  for (const opacity of [0.25, 0.5, 0.75]) {
    const found = (await alphas(opacity)).filter((_, i) => whole[i] > 0.999);
    const mean = found.reduce((sum, alpha) => sum + alpha, 0) / found.length;
    console.log(`opacity ${opacity}: ${mean.toFixed(3)} of ${found.length} opaque pixels`);
    assert.ok(Math.abs(mean - opacity) < 0.12, `${mean} at ${opacity}`);
  }
  scene.destroy();
});

test('the bounds of a world hold what is visible of it', () => {
  const scene = { blocks: [] } as unknown as GaussianScene;
  const bounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 1 } as const;
  const world = new World();
  assert.equal(boundsOfWorld(world), undefined);
  const one = world.add({ scene, bounds, sceneToWorld: all(move(5, 0, 0), stretch(2)) });
  assert.deepEqual(boundsOfWorld(world), { min: [3, -2, -2], max: [7, 2, 2], center: [5, 0, 0], radius: 2 });
  const other = world.add({ scene, bounds, crop: { min: [0, -1, -1], max: [1, 1, 1] } });
  const { min, max, center, radius } = boundsOfWorld(world)!;
  assert.deepEqual(
    [min, max],
    [
      [0, -2, -2],
      [7, 2, 2],
    ],
  );
  for (const { at, reach } of [
    { at: 5, reach: 2 },
    { at: 0.5, reach: 1 },
  ])
    assert.ok(Math.abs(center[0] - at) + reach <= radius + 1e-9, 'both balls are held');
  one.visible = false;
  assert.deepEqual(boundsOfWorld(world)!.center, [0.5, 0, 0], 'the middle of what a crop leaves');
  other.crop = undefined;
  assert.deepEqual(boundsOfWorld(world), bounds);
});
