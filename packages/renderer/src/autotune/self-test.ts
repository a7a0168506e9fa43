import { multiply, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { GaussianBuffers } from '../gaussian-buffers.js';
import { BUFFER_USAGE, perDevice, TEXTURE_USAGE } from '../gpu/kernel.js';
import { turn } from '../gpu/page-thread.js';
import { untilItHasRoom } from '../until-it-has-room.js';
import type { GaussianScene } from '../gaussian-scene.js';
import type { FrameSettings } from '../frame-target.js';
import { Viewpoint } from '../viewpoint.js';
import { World } from '../world.js';
import { drawReference, ROW_STEP } from './reference.js';
import type { PackedGaussians } from '../pack/pack.js';
import { packRepeatedSpheres, packSpheres, probeCamera, sphereCloud } from './spheres.js';
import { sumsAndSorts } from './stages-alone.js';

/** Maximum error of a channel of any pixel, for values of 0..1. Float16 blending stays a fifth below this limit. */
const TOLERANCE = 0.02;
/** Maximum mean squared error of the covered pixels, and of the deep ones: 59 dB PSNR. */
const MAX_ERROR = 10 ** -5.9;
/** Number of large splats, which cover much of the image. */
const LARGE = 24;
/**
 * Number of faint splats, one behind another: as many layers as a pixel of a captured scene has. Errors of one sign
 * grow with the layers: float16 blending that rounds to nearest has 67 dB PSNR here, and blending that truncates 46.
 */
const FAINT = 200;
/** Center of the faint splats in world units, and the deep pixels, which all of them cover. */
const FAINT_CENTER = [0.574, -0.751, 2.109] as const;
const DEEP = { left: 126, right: 150, top: 60, bottom: 76 } as const;
/**
 * Number of small splats. With this number each stage has several workgroups, the last of them partly filled, and the
 * sort has two blocks. A third of the splats is outside the image.
 */
const SMALL = 4_500;
/** Size of the image in pixels: several bins of tiles in each direction, the last of them partly outside. */
const [WIDTH, HEIGHT] = [276, 136];
/** Number of elements of a row of pixels, and bytes of the rows that are read: every {@link ROW_STEP}th. */
const ROW = 4 * WIDTH;
const ROW_BYTES = 4 * ROW;
const IMAGE_BYTES = ROW_BYTES * Math.ceil(HEIGHT / ROW_STEP);
/** Bytes of the counts of a frame: see `Viewpoint.copyCounts`. */
const COUNT_BYTES = 16;
/** Bits of the tested sort keys: 16 as in motion, and 32 (exact depths) as at rest. */
const KEY_BITS = [16, 32] as const;
/**
 * Number of different small splats. It is not a multiple of a workgroup's size, so that equal splats are in different
 * lanes.
 */
const SHAPES = 500;

/** `GPUMapMode.READ` as a number, because Node defines this global only if Dawn is loaded. */
const MAP_READ = 1;

/** Expected image, which is computed once for all variants and devices; undefined before the first test. */
let reference: Promise<Float32Array> | undefined;
/** The scenes of the test, packed before the first one. */
let packed: readonly PackedGaussians[] | undefined;

/** Returns the two scenes of the test. */
const testScenes = (): [large: GaussianCloud, small: GaussianCloud] => [
  joined(sphereCloud(LARGE, 0.8), faintCloud()),
  sphereCloud(SMALL, 0.08, 2.4, SHAPES),
];

const packedScenes = (): readonly PackedGaussians[] => {
  const [large, small] = testScenes();
  return [packSpheres(large, 'float16'), packRepeatedSpheres(small, SHAPES)];
};

/** Starts to compute the expected image, which requires no device. */
export const expectedImage = (): Promise<Float32Array> => (reference ??= drawReference(testScenes(), shearedCamera()));

/** Resolves to whether a renderer with these options draws the expected image of two scenes with interleaved splats. */
export const passesSelfTest = async (device: GPUDevice, options: FrameSettings): Promise<boolean> =>
  (await faultOf(device, options)) === undefined;

/** Resolves to the name of the first stage or frame that is wrong with these options; undefined if none is. */
export async function faultOf(device: GPUDevice, options: FrameSettings): Promise<string | undefined> {
  const threads = options.threads === 'serial' ? 'serial' : 'parallel';
  const camera = shearedCamera();
  // The CPU computes the image while the GPU sums and sorts.
  const [isSorted, expected] = await Promise.all([
    perDevice(device, `sums and sorts ${threads}`, () => sumsAndSorts(device, threads)),
    expectedImage(),
  ]);
  if (!isSorted) return `${threads} prefix sums or the ${threads} sort`;
  // Each step is a task of its own, because a page that starts has frames to show meanwhile.
  await turn();
  const scenes: GaussianBuffers[] = [];
  for (const scene of (packed ??= packedScenes()))
    scenes.push(await GaussianBuffers.upload(device, scene, { isCounted: false }));
  const renderer = viewpointOf(device, scenes, options);
  try {
    const images = await drawAll(device, renderer, camera, options);
    const isWrong = images.some((pixels) => !isNear(pixels, expected));
    return isWrong ? `frames of ${options.rasterizer} in ${options.accumulation}, ${threads}` : undefined;
  } finally {
    renderer.destroy();
    for (const scene of scenes) scene.destroy();
  }
}

/**
 * Draws an image for each of {@link KEY_BITS}, and reads all with one read-back, because each takes a browser a
 * millisecond or more.
 */
async function drawAll(
  device: GPUDevice,
  renderer: Viewpoint,
  camera: Camera,
  options: FrameSettings,
): Promise<Float32Array[]> {
  const usage = TEXTURE_USAGE.renderAttachment | TEXTURE_USAGE.copySource;
  const texture = device.createTexture({ label: 'gs.probe', size: [WIDTH, HEIGHT], format: 'rgba32float', usage });
  const step = IMAGE_BYTES + COUNT_BYTES;
  const staging = device.createBuffer({
    label: 'gs.probe',
    size: step * KEY_BITS.length,
    usage: BUFFER_USAGE.mapRead | BUFFER_USAGE.copyDestination,
  });
  const images: Float32Array[] = [];
  try {
    await untilItHasRoom(async () => {
      KEY_BITS.forEach((depthKeyBits, nth) => {
        renderer.draw(camera, { target: texture }, { ...options, depthKeyBits });
        const encoder = device.createCommandEncoder({ label: 'gs.probe' });
        for (let y = 0, offset = nth * step; y < HEIGHT; y += ROW_STEP, offset += ROW_BYTES)
          encoder.copyTextureToBuffer({ texture, origin: [0, y] }, { buffer: staging, offset }, [WIDTH, 1]);
        renderer.copyCounts(encoder, staging, nth * step + IMAGE_BYTES);
        device.queue.submit([encoder.finish()]);
      });
      await staging.mapAsync(MAP_READ);
      const read = staging.getMappedRange();
      const hadRoom = KEY_BITS.map((_, nth) => {
        images[nth] = new Float32Array(read.slice(nth * step, nth * step + IMAGE_BYTES));
        return renderer.hadRoom(new Uint32Array(read.slice(nth * step + IMAGE_BYTES, (nth + 1) * step)));
      });
      staging.unmap();
      return hadRoom.every(Boolean);
    });
    return images;
  } finally {
    texture.destroy();
    staging.destroy();
  }
}

/**
 * Whether all pixels of the computed rows are within {@link TOLERANCE}, and the mean squared errors of the covered
 * pixels and of the {@link DEEP} ones within {@link MAX_ERROR}.
 */
function isNear(pixels: Float32Array, expected: Float32Array): boolean {
  const [all, deep] = errorsOf(pixels, expected);
  return all <= MAX_ERROR && deep <= MAX_ERROR;
}

/**
 * Returns the mean squared errors of the covered pixels of the computed rows, and of the {@link DEEP} ones. Infinity if
 * a pixel is not within {@link TOLERANCE}.
 */
function errorsOf(pixels: Float32Array, expected: Float32Array): readonly [all: number, deep: number] {
  let [sum, covered] = [0, 0];
  let [deepSum, deepCount] = [0, 0];
  for (let row = 0, begin = 0; begin < expected.length; row += ROW_STEP, begin += ROW) {
    const isDeepRow = row >= DEEP.top && row < DEEP.bottom;
    for (let k = 0; k < ROW; k += 4) {
      const at = begin + k;
      const red = pixels[at] - expected[at];
      const green = pixels[at + 1] - expected[at + 1];
      const blue = pixels[at + 2] - expected[at + 2];
      const alpha = pixels[at + 3] - expected[at + 3];
      // NaN fails the comparison, too.
      const worst = Math.max(Math.abs(red), Math.abs(green), Math.abs(blue), Math.abs(alpha));
      if (!(worst <= TOLERANCE)) return [Infinity, Infinity];
      const square = red * red + green * green + blue * blue + alpha * alpha;
      sum += square;
      if (expected[at + 3] > 0) covered += 4;
      if (!isDeepRow || k < 4 * DEEP.left || k >= 4 * DEEP.right) continue;
      deepSum += square;
      deepCount += 4;
    }
  }
  return [sum / covered, deepSum / deepCount];
}

/** Returns faint spheres at almost one place, behind the others. */
function faintCloud(): GaussianCloud {
  const cloud = sphereCloud(FAINT, 1, 0.02);
  const scales = cloud.scales.map((radius) => 0.1 + radius);
  const opacities = cloud.opacities.map((opacity) => 0.05 * opacity);
  return { ...cloud, positions: cloud.positions.map((x, i) => x + FAINT_CENTER[i % 3]), scales, opacities };
}

/** Returns a cloud with the splats of both. */
function joined(a: GaussianCloud, b: GaussianCloud): GaussianCloud {
  const both = (key: 'positions' | 'scales' | 'rotations' | 'opacities' | 'sh'): Float32Array =>
    Float32Array.of(...a[key], ...b[key]);
  return {
    ...{ ...a, count: a.count + b.count, positions: both('positions'), scales: both('scales') },
    ...{ rotations: both('rotations'), opacities: both('opacities'), sh: both('sh') },
  };
}

/** Returns a viewpoint of a new world that contains only these scenes. */
export function viewpointOf(device: GPUDevice, scenes: readonly GaussianScene[], settings: FrameSettings): Viewpoint {
  const world = new World();
  for (const scene of scenes) world.add({ scene });
  return new Viewpoint(device, world, { settings });
}

/** Returns {@link probeCamera} with a shear. Spheres become slanted ellipses, so that the test detects a wrong slope. */
function shearedCamera(): Camera {
  const camera = probeCamera(WIDTH, HEIGHT);
  const shear = [1, 0.7, 0, 0, 0, 0.6, 0.2, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  return { ...camera, worldToCamera: multiply(shear, camera.worldToCamera) };
}
