/** Tests the stages that few scenes need, when a device first needs them. Loaded on demand. */
import { halfToNumber, type GaussianCloud } from '@gaussian-splat/core';
import type { AttributeSlice, GaussianAttribute, GaussianLayout } from '@gaussian-splat/core/contract';
import { capture } from '../capture.js';
import { DynamicGaussians } from '../dynamic-gaussians.js';
import { GaussianBuffers } from '../gaussian-buffers.js';
import { constants } from '../generated/shaders.js';
import { BUFFER_USAGE, perDevice } from '../gpu/kernel.js';
import { GpuMemory } from '../gpu/memory.js';
import { DETAIL_NUMBERS, DETAIL_PLACES, ENDLESS } from '../levels/chunk-detail.js';
import { DetailedGaussians } from '../levels/detailed-gaussians.js';
import { halfBits } from '../pack/half.js';
import { packKept, type PackedGaussians } from '../pack/pack.js';
import { readPacked } from '../pack/packed-scene.js';
import { shReader, unpackSplat } from '../pack/unpack.js';
import { CHUNK_NUMBERS, GEOMETRY_WORDS, shWords } from '../pack/words.js';
import type { FrameSettings } from '../frame-target.js';
import { variantsOf, faultsOf } from '../variants.js';
import { wrongImage } from './search.js';
import { HEIGHT, isNear, viewpointOf, WIDTH } from './self-test.js';
import { packSpheres, probeCamera, sphereCloud } from './spheres.js';

/** Number of rows of a generator: several workgroups, the last of them partly filled. */
const ROWS = 2_600;
/** Maximum difference of packed numbers of around 1. Covariances are squares, which lose half of the digits. */
const ROUNDING = 2e-3;
const { CULL_GROUP, NO_CHILDREN } = constants;

/** Resolves to whether the GPU packs the Gaussians of generators as the CPU does. The result is cached for each device. */
export const packsTensors = (device: GPUDevice): Promise<boolean> =>
  tested(device, 'packing the Gaussians of generators', async () => {
    for (const written of [asHalves(), asCovariances()]) if (!(await isPacked(device, written))) return false;
    return true;
  });

/** Resolves to whether the GPU selects levels of detail as it should. The result is cached for each device. */
export const selectsLevels = (device: GPUDevice, settings: FrameSettings = variantsOf(device)): Promise<boolean> =>
  tested(device, 'levels of detail', () => areSelected(device, settings));

const tested = (device: GPUDevice, what: string, test: () => Promise<boolean>): Promise<boolean> =>
  perDevice(device, `right ${what}`, async () => {
    // A test that fails, without memory or on a lost device, says nothing about the stages.
    const isRight = await test().catch(() => true);
    if (!isRight) faultsOf(device).push(`The self-test finds errors of this GPU: ${what}.`);
    return isRight;
  });

/** Throws `unsupported/wrong-image` unless the GPU packs the Gaussians of generators correctly. */
export async function requirePacking(device: GPUDevice): Promise<void> {
  if (!(await packsTensors(device))) throw wrongImage(device);
}

/** Throws `unsupported/wrong-image` unless the GPU selects levels of detail correctly. */
export async function requireLevels(device: GPUDevice): Promise<void> {
  if (!(await selectsLevels(device))) throw wrongImage(device);
}

/** Gaussians as a generator writes them, and the same Gaussians as the CPU reads them. */
interface Written {
  readonly cloud: GaussianCloud;
  readonly layout: GaussianLayout;
  readonly tensors: Readonly<Record<string, Uint16Array<ArrayBuffer> | Float32Array<ArrayBuffer>>>;
}

/** Spheres whose axes are rotated and scaled differently. */
function ellipsoids(): GaussianCloud {
  const cloud = sphereCloud(ROWS, 4, 2.4);
  return {
    ...cloud,
    scales: cloud.scales.map((value, i) => value * [1, 0.6, 1.7][(i + (i >> 4)) % 3]),
    rotations: cloud.rotations.map((_, i) => Math.sin(1.7 * i + (i >> 3))),
  };
}

const slice = (attribute: GaussianAttribute, components: number, more: Partial<AttributeSlice>): AttributeSlice => ({
  ...{ attribute, components, tensor: attribute, offset: 0, rowStride: components, activation: 'linear' },
  ...more,
});

const layoutOf = (dtype: GaussianLayout['dtype'], attributes: readonly AttributeSlice[]): GaussianLayout => ({
  ...{ capacity: ROWS, isDynamic: false, dtype, shDegree: 1, attributes, count: undefined },
});

/** One float16 tensor: logarithms of scales, quaternions with w first, logits, harmonics by coefficient. */
function asHalves(): Written {
  const { positions, scales, rotations, opacities, sh, ...facts } = ellipsoids();
  const columns = [
    { values: positions, width: 3, encode: (x: number) => x, decode: (x: number) => x },
    { values: scales, width: 3, encode: Math.log, decode: Math.exp },
    { values: rotations, width: 4, encode: (x: number) => x, decode: (x: number) => x },
    {
      ...{ values: opacities, width: 1 },
      encode: (x: number) => Math.log(x / (1 - x)),
      decode: (x: number) => 1 / (1 + Math.exp(-x)),
    },
    { values: sh, width: 12, encode: (x: number) => x, decode: (x: number) => x },
  ];
  const rowStride = columns.reduce((sum, { width }) => sum + width, 0);
  const gaussians = new Uint16Array(ROWS * rowStride);
  let offset = 0;
  for (const { values, width, encode, decode } of columns) {
    for (let i = 0; i < values.length; i++) {
      const bits = halfBits(encode(values[i]));
      gaussians[Math.floor(i / width) * rowStride + offset + (i % width)] = bits;
      values[i] = decode(halfToNumber(bits));
    }
    offset += width;
  }
  const place = (at: number): Pick<AttributeSlice, 'tensor' | 'offset' | 'rowStride'> => ({
    ...{ tensor: 'gaussians', offset: at, rowStride },
  });
  const layout = layoutOf('float16', [
    slice('positions', 3, place(0)),
    slice('scales', 3, { ...place(3), activation: 'log' }),
    slice('rotations', 4, { ...place(6), quaternionOrder: 'wxyz' }),
    slice('opacities', 1, { ...place(10), activation: 'logit' }),
    slice('sh', 12, { ...place(11), shOrder: 'coefficient-major' }),
  ]);
  return { cloud: { ...facts, positions, scales, rotations, opacities, sh }, layout, tensors: { gaussians } };
}

/** A float32 tensor for each attribute: covariances, and harmonics by channel. */
function asCovariances(): Written {
  const cloud = ellipsoids();
  const { geometry } = packKept(cloud, everyOne(ROWS), 'float16');
  const { factors } = unpacked(geometry);
  const covariances = new Float32Array(6 * ROWS);
  for (let i = 0; i < ROWS; i++) {
    const [xx, yx, yy, zx, zy, zz] = factors.subarray(6 * i, 6 * i + 6);
    covariances.set(
      [xx * xx, xx * yx, xx * zx, yx * yx + yy * yy, yx * zx + yy * zy, zx * zx + zy * zy + zz * zz],
      6 * i,
    );
  }
  const sh = cloud.sh.map((_, i) => cloud.sh[12 * Math.floor(i / 12) + 3 * (i % 4) + Math.floor((i % 12) / 4)]);
  const { positions, opacities } = cloud;
  const layout = layoutOf('float32', [
    slice('positions', 3, {}),
    slice('covariances', 6, {}),
    slice('opacities', 1, {}),
    slice('sh', 12, { shOrder: 'channel-major' }),
  ]);
  return { cloud, layout, tensors: { positions, covariances, opacities, sh } as Written['tensors'] };
}

async function isPacked(device: GPUDevice, { cloud, layout, tensors }: Written): Promise<boolean> {
  const memory = new GpuMemory(device);
  const gaussians = await DynamicGaussians.create(device, layout);
  try {
    const { storage, copyDestination } = BUFFER_USAGE;
    const upload = (words: Uint16Array<ArrayBuffer> | Float32Array<ArrayBuffer>): GPUBuffer => {
      const bytes = new Uint8Array(4 * Math.ceil(words.byteLength / 4));
      bytes.set(new Uint8Array(words.buffer));
      return memory.buffer('gs.probe', bytes.length, storage | copyDestination, new Uint32Array(bytes.buffer));
    };
    const buffers = Object.entries(tensors).map(([name, words]) => [name, upload(words)] as const);
    gaussians.ingest(Object.fromEntries(buffers), ROWS);
    const found = await readPacked(device, gaussians);
    const expected = packKept(cloud, everyOne(ROWS), 'float16');
    return isEqual(numbersIn(found), numbersIn({ ...found, ...expected })) && areBounds(found.chunks, expected.chunks);
  } finally {
    gaussians.destroy();
    memory.destroy();
  }
}

const everyOne = (count: number): Uint32Array => new Uint32Array(count).map((_, i) => i);

function unpacked(geometry: Uint32Array): Record<'positions' | 'factors' | 'opacities', Float32Array> {
  const count = geometry.length / GEOMETRY_WORDS;
  const [positions, factors, opacities] = [3, 6, 1].map((width) => new Float32Array(width * count));
  for (let i = 0; i < count; i++) unpackSplat(geometry, i, positions, factors, opacities);
  return { positions, factors, opacities };
}

/** Returns the positions, factors, opacities and harmonics of packed Gaussians, one array after the other. */
function numbersIn(packed: PackedGaussians): Float32Array {
  const { positions, factors, opacities } = unpacked(packed.geometry);
  const sh = new Float32Array(12 * packed.count);
  shReader(packed)(0, packed.count, sh);
  const all = new Float32Array((3 + 6 + 1 + 12) * packed.count);
  let at = 0;
  for (const part of [positions, factors, opacities, sh]) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

/** Whether all numbers, which are around 1, are equal except for rounding. NaN is not. */
const isEqual = (found: Float32Array, expected: Float32Array): boolean =>
  found.length === expected.length && found.every((value, i) => Math.abs(value - expected[i]) <= ROUNDING);

/** Maximum ratio of the reach of a splat that the GPU estimates, by the trace of its covariance, to its reach. */
const LONGEST_REACH = 1.001 * Math.sqrt(3) + ROUNDING;

/** Whether bounds of chunks are those of the splats. */
function areBounds(found: Float32Array, expected: Float32Array): boolean {
  const REACH = 3;
  return found.every((value, i) => {
    if (i % CHUNK_NUMBERS !== REACH) return Math.abs(value - expected[i]) <= ROUNDING;
    return value >= expected[i] - ROUNDING && value <= LONGEST_REACH * expected[i];
  });
}

/** Number of coarse chunks, each of which replaces four fine ones. */
const PARENTS = 4;
/** Errors of the coarse chunks in pixels, in any order. */
const ERRORS = [1.6, 0.1, 6.4, 0.4];
/** Settings, and the coarse chunks that are drawn with them. Without the others, a frame has 768 splats more for each. */
const SELECTIONS = [
  { settings: { detail: 1, splatBudget: 0 }, drawn: [1, 3] },
  { settings: { detail: 0.2, splatBudget: 2_000 }, drawn: [0, 1, 3] },
];

async function areSelected(device: GPUDevice, settings: FrameSettings): Promise<boolean> {
  const fine = packSpheres(sphereCloud(4 * PARENTS * CULL_GROUP, 0.3, 2.4), 'float16');
  const coarse = packSpheres(sphereCloud(PARENTS * CULL_GROUP, 0.8, 1.7), 'float16');
  const camera = probeCamera(WIDTH, HEIGHT);
  // All chunks have one sphere of radius 0 at the origin, so that errors in pixels are known.
  const { worldToCamera: m, fx } = camera;
  const perPixel = Math.hypot(m[3], m[7], m[11]) / fx;
  const rows = (count: number, fill: (row: Float32Array, chunk: number) => void): Float32Array => {
    const all = new Float32Array(DETAIL_NUMBERS * count);
    for (let c = 0; c < count; c++) {
      const row = all.subarray(DETAIL_NUMBERS * c, DETAIL_NUMBERS * (c + 1));
      new Uint32Array(all.buffer)[DETAIL_NUMBERS * c + DETAIL_PLACES.children] = NO_CHILDREN;
      fill(row, c);
    }
    return all;
  };
  const leafDetails = rows(4 * PARENTS, (row, c) => {
    row[DETAIL_PLACES.parentError] = ERRORS[c >> 2] * perPixel;
  });
  const details = rows(PARENTS, (row, c) => {
    row[DETAIL_PLACES.error] = row[DETAIL_PLACES.fullError] = ERRORS[c] * perPixel;
    row[DETAIL_PLACES.parentError] = ENDLESS;
  });
  const scene = await GaussianBuffers.upload(device, fine);
  const detailed = await DetailedGaussians.upload(device, scene, { leafDetails, coarser: { ...coarse, details } });
  const viewpoint = viewpointOf(device, [detailed], settings);
  try {
    for (const { settings: own, drawn } of SELECTIONS) {
      const pixels = await capture(device, viewpoint, { camera, settings: { ...settings, ...own, detailFade: 0 } });
      const isCoarse = (parent: number): boolean => drawn.includes(parent);
      const kept = [
        ...Array.from({ length: 4 * PARENTS }, (_, c) => ({ packed: fine, c })).filter(({ c }) => !isCoarse(c >> 2)),
        ...drawn.map((c) => ({ packed: coarse, c })),
      ];
      if (!isNear(pixels, await drawnAlone(device, joined(kept), camera, settings), 1)) return false;
    }
    return true;
  } finally {
    viewpoint.destroy();
    detailed.destroy();
    scene.destroy();
  }
}

async function drawnAlone(
  device: GPUDevice,
  packed: PackedGaussians,
  camera: ReturnType<typeof probeCamera>,
  settings: FrameSettings,
): Promise<Float32Array> {
  const scene = await GaussianBuffers.upload(device, packed);
  const viewpoint = viewpointOf(device, [scene], settings);
  try {
    return await capture(device, viewpoint, { camera, settings });
  } finally {
    viewpoint.destroy();
    scene.destroy();
  }
}

/** Joins chunks of packed scenes to one scene. */
function joined(kept: readonly { readonly packed: PackedGaussians; readonly c: number }[]): PackedGaussians {
  const [{ packed: facts }] = kept;
  const words = (part: 'geometry' | 'sh' | 'chunks', stride: number): number[] =>
    kept.flatMap(({ packed, c }) => [...packed[part].subarray(stride * c, stride * (c + 1))]);
  const { shDegree, shPrecision } = facts;
  return {
    ...facts,
    count: kept.length * CULL_GROUP,
    geometry: Uint32Array.from(words('geometry', GEOMETRY_WORDS * CULL_GROUP)),
    sh: Uint32Array.from(words('sh', shWords(shDegree, shPrecision) * CULL_GROUP)),
    chunks: Float32Array.from(words('chunks', CHUNK_NUMBERS)),
  };
}
