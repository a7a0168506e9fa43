import { normalize, subtract, eyeOf, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import type { Threads } from '@gaussian-splat/renderer/tools';
import {
  cameraValues,
  constants,
  cullChunksStage,
  cullGroups,
  cullStage,
  layouts,
  mortonOrder,
  projectStage,
  SH_PRECISION,
  writeStruct,
} from '@gaussian-splat/renderer/stages';
import { projectEllipse, toCamera, worldPosition } from '../../oracle/projection.js';
import { RULES } from '../../oracle/rules.js';
import { splatColor } from '../../oracle/sh.js';
import { check, checkEqual, type Bench, type StageCase } from '../../support/gpu.js';
import {
  edgeOnDiscs,
  hugeSplats,
  needles,
  offCenter,
  pixelSplats,
  room,
  thinned,
  type Scene,
} from '../../support/scenes.js';
import { DEFAULT_SETTINGS } from './view.js';

const { CULL_GROUP, WORDS_PER_GROUP } = constants;

/** Everything that `cull` and `project` read, on the GPU. */
function uploadScene(
  bench: Bench,
  packed: PackedGaussians,
  camera: Camera,
): { view: GPUBuffer; gaussians: GPUBuffer; sh: GPUBuffer; chunks: GPUBuffer } {
  const bytes = new ArrayBuffer(layouts.View.size);
  const page = { splat_count: packed.count, page: 0, first_group: 0 };
  const flags = {
    antialiased: packed.antialiased ? 1 : 0,
    key_bits: 32,
    ...DEFAULT_SETTINGS,
  };
  const sh = { sh_degree: packed.shDegree, sh_cap: 3, sh_encoding: SH_PRECISION[packed.shPrecision] };
  writeStruct(layouts.View, { ...cameraValues(camera, packed.origin), ...page, ...sh, ...flags }, bytes);
  return {
    view: bench.uniform(...new Uint32Array(bytes)),
    gaussians: bench.buffer(packed.geometry),
    sh: bench.buffer(packed.sh),
    chunks: bench.buffer(new Uint32Array(packed.chunks.buffer)),
  };
}

/** Visibility flags of all splats, how many were refused as unusable, and the number of visited chunks. */
export async function cullOnGpu(
  bench: Bench,
  packed: PackedGaussians,
  camera: Camera,
  threads?: Threads,
): Promise<{ visible: boolean[]; unusable: number; chunksSeen: number }> {
  const { view, gaussians, chunks } = uploadScene(bench, packed, camera);
  const groups = cullGroups(packed.count);
  // Values that `cull` does not write must come from `cull_chunks`: garbage would show.
  const bits = bench.buffer(new Uint32Array(WORDS_PER_GROUP * groups).fill(0xffffffff));
  const counts = bench.buffer(new Uint32Array(groups).fill(0xffffffff));
  const cull_stats = bench.buffer(4 * constants.CULL_STATS_WORDS);
  const shared = { view, visible_bits: bits, group_counts: counts };
  const shares = bench.buffer(4 * (groups + 1));
  const [chunkStage, stage] = [cullChunksStage(bench.device), cullStage(bench.device, threads)];
  const chunkBindings = chunkStage.bind({
    ...shared,
    chunks,
    details: chunks,
    chunk_shares: shares,
  });
  const bindings = stage.bind({
    ...{ ...shared, gaussians, cull_stats },
    chunk_shares: shares,
  });
  bench.compute((pass) => {
    chunkStage.record(pass, chunkBindings, packed.count);
    stage.record(pass, bindings, packed.count);
  });
  const [words, groupCounts, counters] = [
    await bench.read(bits),
    await bench.read(counts),
    await bench.read(cull_stats),
  ];
  const visible = Array.from({ length: packed.count }, (_, i) => ((words[Math.floor(i / 32)] >>> (i % 32)) & 1) === 1);
  const expected = new Uint32Array(groups);
  visible.forEach((flag, i) => (expected[Math.floor(i / CULL_GROUP)] += flag ? 1 : 0));
  checkEqual(groupCounts, expected, 'group counts');
  const drawn = new Float32Array((await bench.read(shares)).buffer).subarray(0, groups);
  const chunksSeen = drawn.filter((share) => share > 0).length;
  return { visible, unusable: counters[constants.UNUSABLE], chunksSeen };
}

/** The twin: does a splat reach the center of a pixel? `margin` in pixels widens (or narrows) its box. */
function isVisibleTwin(cloud: GaussianCloud, i: number, camera: Camera, margin: number): boolean {
  const center = toCamera(camera, worldPosition(cloud, i));
  const depth = center[2];
  // Depths this close to a plane may fall on either side in float32.
  const slack = Math.sign(margin) * 1e-6 * Math.abs(depth);
  if (depth <= camera.near - slack || depth >= camera.far + slack) return false;
  const ellipse = projectEllipse(cloud, i, camera, center, RULES.gsplat);
  const opacity = cloud.opacities[i] * (cloud.antialiased ? ellipse.compensation : 1);
  if (opacity < (1 / 255) * (1 - 1e-5 * Math.sign(margin))) return false;
  const radius = Math.sqrt(2 * Math.max(0, Math.log(255 * opacity)));
  const covers = (at: number, variance: number, size: number): boolean => {
    const reach = radius * Math.sqrt(variance) * (1 + 1e-5 * Math.sign(margin)) + margin;
    return Math.max(0, Math.ceil(at - reach - 0.5)) <= Math.min(size - 1, Math.floor(at + reach - 0.5));
  };
  return (
    covers(ellipse.x, ellipse.covariance.xx, camera.width) && covers(ellipse.y, ellipse.covariance.yy, camera.height)
  );
}

/** Index in the cloud of each packed splat: all of them are usable. */
const packedOrder = ({ positions, count }: GaussianCloud): Uint32Array =>
  mortonOrder(
    positions,
    Uint32Array.from({ length: count }, (_, i) => i),
  );

async function checkCull(bench: Bench, cloud: GaussianCloud, camera: Camera): Promise<void> {
  const culled = await cullOnGpu(bench, packGaussians(cloud), camera);
  const visible: boolean[] = [];
  packedOrder(cloud).forEach((i, slot) => (visible[i] = culled.visible[slot]));
  let seen = 0;
  for (let i = 0; i < cloud.count; i++) {
    const [surely, perhaps] = [isVisibleTwin(cloud, i, camera, -0.01), isVisibleTwin(cloud, i, camera, 0.01)];
    check(!surely || visible[i], `splat ${i} is visible but was culled`);
    check(perhaps || !visible[i], `splat ${i} paints nothing but was kept`);
    seen += visible[i] ? 1 : 0;
  }
  check(seen > 0, 'nothing was visible: the case tests nothing');
}

const bits = new Uint32Array(1);
const float = new Float32Array(bits.buffer);
const asFloat = (word: number): number => ((bits[0] = word), float[0]);
function halfToNumber(half: number): number {
  const [sign, exponent, mantissa] = [half & 0x8000 ? -1 : 1, (half >> 10) & 31, half & 1023];
  return sign * (exponent === 0 ? mantissa * 2 ** -24 : (1024 + mantissa) * 2 ** (exponent - 25));
}

/** Projected splats and keys of all splats, visible or not, with the kernels of `device`. */
export async function projectOnGpu(
  bench: Bench,
  packed: PackedGaussians,
  camera: Camera,
  device = bench.device,
): Promise<{ splats: Uint32Array; keys: Uint32Array }> {
  const { view, gaussians, sh } = uploadScene(bench, packed, camera);
  const { count } = packed;
  const plan = new Uint32Array((layouts.Plan.size + layouts.PagePlan.size) / 4);
  plan.set([0, count], layouts.Plan.size / 4);
  const planBuffer = bench.buffer(plan);
  const splats = bench.buffer(layouts.ProjectedSplat.size * count);
  const keys = bench.buffer(4 * count);
  const survivors = bench.buffer(Uint32Array.from({ length: count }, (_, i) => i));
  const cull_stats = bench.buffer(4 * constants.CULL_STATS_WORDS);
  const stage = projectStage(device);
  const chunk_shares = bench.buffer(new Uint32Array(new Float32Array(cullGroups(count) + 1).fill(1).buffer));
  const bindings = stage.bind({
    view,
    gaussians,
    sh,
    survivors,
    plan: planBuffer,
    cull_stats,
    splats,
    keys,
    chunk_shares,
  });
  bench.compute((pass) => stage.record(pass, bindings, count + 1000));
  return { splats: await bench.read(splats), keys: await bench.read(keys) };
}

/** |a - b| relative to the larger of |b| and `floor`. */
const relative = (a: number, b: number, floor = 0): number => Math.abs(a - b) / Math.max(Math.abs(b), floor);

async function checkProject(bench: Bench, cloud: GaussianCloud, camera: Camera): Promise<void> {
  const { splats, keys } = await projectOnGpu(bench, packGaussians(cloud, { sh: 'float16' }), camera);
  const eye = eyeOf(camera.worldToCamera);
  let compared = 0;
  for (const [slot, i] of packedOrder(cloud).entries()) {
    if (!isVisibleTwin(cloud, i, camera, 0)) continue;
    const position = worldPosition(cloud, i);
    const center = toCamera(camera, position);
    const e = projectEllipse(cloud, i, camera, center, RULES.gsplat);
    const words = splats.subarray(8 * slot, 8 * slot + 8);
    const [x, y, inverseSigmaX, slope, inverseSigmaV] = Array.from(words.subarray(0, 5), asFloat);
    // A point left by cancellation has the rounding of its largest term: pixels per 2^-22 of the coordinates.
    const scale = Math.hypot(...subtract(position, eye)) + Math.hypot(...position);
    const pixelError = 4 * camera.fx * (scale / center[2]) * 2 ** -22 + 1e-6 * (Math.abs(e.x) + Math.abs(e.y));
    check(
      Math.abs(x - e.x) <= pixelError && Math.abs(y - e.y) <= pixelError,
      `splat ${i}: center ${x}, ${y}, expected ${e.x}, ${e.y}`,
    );
    // The factor of the covariance is stored to 14 bits: axes on the screen are off by 2^-15 of the longest.
    const sigmaX = 1 / inverseSigmaX;
    const { xx, xy, yy } = e.covariance;
    const depthError = (8 * scale * 2 ** -23) / center[2];
    const longest = Math.max(...cloud.scales.subarray(3 * i, 3 * i + 3));
    const slant = Math.hypot(center[0], center[1], center[2]) / center[2];
    const axisError = 2 * 2 ** -15 * ((longest * Math.max(camera.fx, camera.fy)) / center[2]) * slant;
    const varianceError = (variance: number): number => 1e-4 + 4 * depthError + (2 * axisError) / Math.sqrt(variance);
    check(
      relative(sigmaX * sigmaX, xx) <= varianceError(xx),
      `splat ${i}: variance of x ${sigmaX ** 2}, expected ${xx}`,
    );
    check(
      relative(slope * sigmaX * sigmaX, xy, Math.sqrt(xx * yy)) <= varianceError(xx) + varianceError(yy),
      `splat ${i}: covariance ${slope * sigmaX ** 2}, expected ${xy}`,
    );
    const conditional = 1 / e.conic.yy;
    check(
      relative(1 / inverseSigmaV ** 2, conditional) <= 2e-3 + 100 * depthError + varianceError(conditional),
      `splat ${i}: variance about the line ${1 / inverseSigmaV ** 2}, expected ${conditional}`,
    );
    const color = [words[5] & 0xffff, words[5] >>> 16, words[6] & 0xffff].map(halfToNumber);
    const expected = splatColor(cloud, i, normalize(subtract(position, eye)));
    const coefficients = cloud.sh.subarray(
      (i * cloud.sh.length) / cloud.count,
      ((i + 1) * cloud.sh.length) / cloud.count,
    );
    // Coefficients are float16: half a unit in the last place of each.
    const shError = coefficients.reduce((sum, c) => sum + Math.abs(c), 0) * 2 ** -11 + 1e-5;
    expected.forEach((c, k) =>
      check(Math.abs(color[k] - c) <= shError + c * 2 ** -11, `splat ${i}: color ${color}, expected ${expected}`),
    );
    const opacity = cloud.opacities[i] * (cloud.antialiased ? e.compensation : 1);
    // Compensation is the thin axis against the same axis dilated: an error of one shows in the other.
    const thinError = cloud.antialiased ? axisError / (e.compensation * Math.sqrt(conditional)) : 0;
    check(
      relative(asFloat(words[7]), opacity) <= 2e-3 + 100 * depthError + thinError,
      `splat ${i}: opacity ${asFloat(words[7])}, expected ${opacity}`,
    );
    check(
      relative(asFloat(keys[slot]), center[2]) <= 1e-6 + depthError,
      `splat ${i}: depth ${asFloat(keys[slot])}, expected ${center[2]}`,
    );
    compared++;
  }
  check(compared > 0, 'no splat was compared');
}

/** Every number of every splat is compared with the oracle's: enough of them for many chunks. */
const COMPARED = 6_000;

const scenes: readonly (() => Scene)[] = [room, needles, hugeSplats, pixelSplats, edgeOnDiscs, offCenter];

const geometryCases = scenes.flatMap((make) =>
  [false, true].flatMap((antialiased): StageCase[] => {
    let made: Scene | undefined;
    const label = `${make.name}, ${antialiased ? 'antialiased' : 'classic'}`;
    const each = (checkOne: typeof checkCull) => async (bench: Bench) => {
      const { cloud, cameras } = (made ??= thinned(make(), COMPARED));
      for (const camera of cameras) await checkOne(bench, { ...cloud, antialiased }, camera);
    };
    return [
      { name: `cull: ${label}`, run: each(checkCull) },
      { name: `project: ${label}`, run: each(checkProject) },
    ];
  }),
);

/** Positions of the numbers in a packed splat: word, and the bits that hold the number's highest. */
const PACKED_NUMBERS = [0, 1, 2, 3, 4, 5, 6, 7].map((word) => ({ name: `word ${word}`, word }));

/** A packed scene with a copy of each splat spoilt in one way behind it, as a buffer that no CPU has checked. */
function withSpoiltCopies(packed: PackedGaussians): { packed: PackedGaussians; faults: string[] } {
  const stride = layouts.PackedGaussian.size / 4;
  const faults: { name: string; spoil: (words: Uint32Array) => void }[] = [];
  for (const { name, word } of PACKED_NUMBERS) {
    for (const [what, bits] of [
      ['NaN', 0x7fc00000],
      ['Infinity', 0x7f800000],
      ['-Infinity', 0xff800000],
    ] as const) {
      // The lower 10 bits belong to other numbers, which stay as they are.
      faults.push({ name: `${name} ${what}`, spoil: (w) => (w[word] = bits | (word < 3 ? 0 : w[word] & 0x3ff)) });
    }
  }
  faults.push(
    // The sixth number of the factor and the opacity lie in the lower bits of several words.
    {
      name: 'factor zz Infinity',
      spoil: (w) => ((w[3] = (w[3] & ~0x3ff) | 0x1fe), (w[4] &= ~0x3ff), (w[5] &= ~0x300)),
    },
    { name: 'opacity Infinity', spoil: (w) => ((w[5] = (w[5] & ~0xff) | 0x7f), (w[6] = (w[6] & ~0x3ff) | 0x200)) },
    { name: 'factor 0', spoil: (w) => ((w[3] &= 0), (w[4] &= 0), (w[5] &= 0xff), (w[6] &= 0x3ff), (w[7] &= 0x3ff)) },
    { name: 'factor 1e30', spoil: (w) => (w[3] = 0x7149f000 | (w[3] & 0x3ff)) },
  );
  const count = packed.count + faults.length;
  const geometry = new Uint32Array(stride * count);
  geometry.set(packed.geometry);
  faults.forEach(({ spoil }, k) => {
    const at = stride * (packed.count + k);
    geometry.copyWithin(at, stride * (k % packed.count), stride * ((k % packed.count) + 1));
    spoil(geometry.subarray(at, at + stride));
  });
  const sh = new Uint32Array((packed.sh.length / packed.count) * count);
  // No chunk of a buffer that was not packed here has known bounds.
  const chunk = [-1e30, -1e30, -1e30, 1e30, 1e30, 1e30, 1e30, 0];
  const chunks = Float32Array.from({ length: 8 * cullGroups(count) }, (_, i) => chunk[i % 8]);
  return { packed: { ...packed, count, geometry, sh, chunks }, faults: faults.map(({ name }) => name) };
}

/** A cloud in two far places; a camera sees one of them. */
function twoPlaces(): { cloud: GaussianCloud; camera: Camera } {
  const { cloud, cameras } = room();
  const positions = cloud.positions.slice();
  for (let i = 0; i < positions.length / 2; i += 3) positions[i] += 1000;
  return { cloud: { ...cloud, positions }, camera: cameras[0] };
}

export const projectionCases: readonly StageCase[] = [
  ...geometryCases,
  {
    name: 'cull: chunks out of view are not looked into, and what they left behind is cleared',
    run: async (bench) => {
      const { cloud, camera } = twoPlaces();
      const { chunksSeen } = await cullOnGpu(bench, packGaussians(cloud), camera);
      const all = cullGroups(cloud.count);
      check(chunksSeen > 0 && chunksSeen < 0.6 * all, `${chunksSeen} of ${all} chunks were read`);
      await checkCull(bench, cloud, camera);
    },
  },
  {
    name: 'cull: refuses and counts splats with unusable geometry, and decides the others as without them',
    run: async (bench) => {
      const { cloud, cameras } = offCenter();
      const packed = packGaussians(cloud);
      const spoilt = withSpoiltCopies(packed);
      const alone = await cullOnGpu(bench, packed, cameras[0]);
      for (const threads of ['parallel', 'serial'] as const) {
        const mixed = await cullOnGpu(bench, spoilt.packed, cameras[0], threads);
        alone.visible.forEach((flag, i) => check(mixed.visible[i] === flag, `good splat ${i} changed, ${threads}`));
        spoilt.faults.forEach((fault, k) => check(!mixed.visible[packed.count + k], `${fault} was drawn, ${threads}`));
        check(mixed.unusable === spoilt.faults.length, `${mixed.unusable} refused of ${spoilt.faults.join(', ')}`);
      }
    },
  },
];
