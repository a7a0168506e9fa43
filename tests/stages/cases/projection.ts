import { normalize, subtract, eyeOf, type Camera, type GaussianCloud } from '@gaussian-splat/core';
import { packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import {
  cameraValues,
  constants,
  cullGroups,
  CullStage,
  layouts,
  ProjectStage,
  writeStruct,
} from '@gaussian-splat/renderer/stages';
import { projectEllipse, toCamera, worldPosition } from '../../oracle/projection.js';
import { RULES } from '../../oracle/rules.js';
import { splatColor } from '../../oracle/sh.js';
import { check, checkEqual, type Bench, type StageCase } from '../../support/gpu.js';
import { withHostileSplats } from '../../support/hostile.js';
import { edgeOnDiscs, hugeSplats, needles, offCentre, pixelSplats, room, type Scene } from '../../support/scenes.js';

const { CULL_GROUP, WORDS_PER_GROUP, PROJECT_GROUP } = constants;

/** Everything that `cull` and `project` read, on the GPU. */
function uploadScene(
  bench: Bench,
  packed: PackedGaussians,
  camera: Camera,
): { view: GPUBuffer; gaussians: GPUBuffer; sh: GPUBuffer } {
  const bytes = new ArrayBuffer(layouts.View.size);
  const page = { splat_count: packed.count, page: 0, first_group: 0 };
  const flags = { sh_degree: packed.shDegree, antialiased: packed.antialiased ? 1 : 0, key_bits: 32 };
  writeStruct(layouts.View, { ...cameraValues(camera, packed.origin), ...page, ...flags }, bytes);
  return {
    view: bench.uniform(...new Uint32Array(bytes)),
    gaussians: bench.buffer(packed.geometry),
    sh: bench.buffer(packed.sh),
  };
}

/** Visibility flags of all splats, and how many were refused as unusable. */
async function cullOnGpu(
  bench: Bench,
  packed: PackedGaussians,
  camera: Camera,
): Promise<{ visible: boolean[]; unusable: number }> {
  const { view, gaussians } = uploadScene(bench, packed, camera);
  const groups = cullGroups(packed.count);
  const bits = bench.buffer(4 * WORDS_PER_GROUP * groups);
  const counts = bench.buffer(4 * groups);
  const plan = bench.buffer(layouts.Plan.size + layouts.PagePlan.size);
  const stage = new CullStage(bench.device);
  const bindings = stage.bind({ view, gaussians, visible_bits: bits, group_counts: counts, plan });
  bench.compute((pass) => stage.record(pass, bindings, packed.count));
  const [words, groupCounts, planWords] = [await bench.read(bits), await bench.read(counts), await bench.read(plan)];
  const visible = Array.from({ length: packed.count }, (_, i) => ((words[Math.floor(i / 32)] >>> (i % 32)) & 1) === 1);
  const expected = new Uint32Array(groups);
  visible.forEach((flag, i) => (expected[Math.floor(i / CULL_GROUP)] += flag ? 1 : 0));
  checkEqual(groupCounts, expected, 'group counts');
  return { visible, unusable: planWords[layouts.Plan.fields.unusable.offset / 4] };
}

/** The twin: does a splat reach the centre of a pixel? `margin` in pixels widens (or narrows) its box. */
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

async function checkCull(bench: Bench, cloud: GaussianCloud, camera: Camera): Promise<void> {
  const { visible } = await cullOnGpu(bench, packGaussians(cloud), camera);
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

async function projectOnGpu(
  bench: Bench,
  packed: PackedGaussians,
  camera: Camera,
): Promise<{ splats: Uint32Array; keys: Uint32Array }> {
  const { view, gaussians, sh } = uploadScene(bench, packed, camera);
  const { count } = packed;
  const plan = new Uint32Array((layouts.Plan.size + layouts.PagePlan.size) / 4);
  plan.set([0, count, Math.ceil(count / PROJECT_GROUP), 1, 1], layouts.Plan.size / 4);
  const planBuffer = bench.buffer(plan);
  const splats = bench.buffer(layouts.ProjectedSplat.size * count);
  const keys = bench.buffer(4 * count);
  const survivors = bench.buffer(Uint32Array.from({ length: count }, (_, i) => i));
  const stage = new ProjectStage(bench.device);
  const bindings = stage.bind({ view, gaussians, sh, survivors, plan: planBuffer, splats, keys });
  bench.compute((pass) => stage.record(pass, bindings, planBuffer, 0));
  return { splats: await bench.read(splats), keys: await bench.read(keys) };
}

/** |a - b| relative to the larger of |b| and `floor`. */
const relative = (a: number, b: number, floor = 0): number => Math.abs(a - b) / Math.max(Math.abs(b), floor);

async function checkProject(bench: Bench, cloud: GaussianCloud, camera: Camera): Promise<void> {
  const { splats, keys } = await projectOnGpu(bench, packGaussians(cloud), camera);
  const eye = eyeOf(camera.worldToCamera);
  let compared = 0;
  for (let i = 0; i < cloud.count; i++) {
    if (!isVisibleTwin(cloud, i, camera, 0)) continue;
    const position = worldPosition(cloud, i);
    const center = toCamera(camera, position);
    const e = projectEllipse(cloud, i, camera, center, RULES.gsplat);
    const words = splats.subarray(8 * i, 8 * i + 8);
    const [x, y, inverseSigmaX, slope, inverseSigmaV] = Array.from(words.subarray(0, 5), asFloat);
    // A point left by cancellation has the rounding of its largest term: pixels per 2^-22 of the coordinates.
    const scale = Math.hypot(...subtract(position, eye)) + Math.hypot(...position);
    const pixelError = 4 * camera.fx * (scale / center[2]) * 2 ** -22 + 1e-6 * (Math.abs(e.x) + Math.abs(e.y));
    check(
      Math.abs(x - e.x) <= pixelError && Math.abs(y - e.y) <= pixelError,
      `splat ${i}: centre ${x}, ${y}, expected ${e.x}, ${e.y}`,
    );
    const sigmaX = 1 / inverseSigmaX;
    const { xx, xy, yy } = e.covariance;
    const depthError = (8 * scale * 2 ** -23) / center[2];
    check(
      relative(sigmaX * sigmaX, xx) <= 1e-4 + 4 * depthError,
      `splat ${i}: variance of x ${sigmaX ** 2}, expected ${xx}`,
    );
    check(
      relative(slope * sigmaX * sigmaX, xy, Math.sqrt(xx * yy)) <= 1e-4 + 4 * depthError,
      `splat ${i}: covariance ${slope * sigmaX ** 2}, expected ${xy}`,
    );
    const conditional = 1 / e.conic.yy;
    check(
      relative(1 / inverseSigmaV ** 2, conditional) <= 2e-3 + 100 * depthError,
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
      check(Math.abs(color[k] - c) <= shError + c * 2 ** -11, `splat ${i}: colour ${color}, expected ${expected}`),
    );
    const opacity = cloud.opacities[i] * (cloud.antialiased ? e.compensation : 1);
    check(
      relative(asFloat(words[7]), opacity) <= 2e-3 + 100 * depthError,
      `splat ${i}: opacity ${asFloat(words[7])}, expected ${opacity}`,
    );
    check(
      relative(asFloat(keys[i]), center[2]) <= 1e-6 + depthError,
      `splat ${i}: depth ${asFloat(keys[i])}, expected ${center[2]}`,
    );
    compared++;
  }
  check(compared > 0, 'no splat was compared');
}

const scenes: readonly (() => Scene)[] = [room, needles, hugeSplats, pixelSplats, edgeOnDiscs, offCentre];

const geometryCases = scenes.flatMap((make) =>
  [false, true].flatMap((antialiased): StageCase[] => {
    const label = `${make.name}, ${antialiased ? 'antialiased' : 'classic'}`;
    const each = (checkOne: typeof checkCull) => async (bench: Bench) => {
      const { cloud, cameras } = make();
      for (const camera of cameras) await checkOne(bench, { ...cloud, antialiased }, camera);
    };
    return [
      { name: `cull: ${label}`, run: each(checkCull) },
      { name: `project: ${label}`, run: each(checkProject) },
    ];
  }),
);

/** Packs without the check that `packGaussians` does, as a buffer that no CPU has seen. */
function packUnchecked(cloud: GaussianCloud): PackedGaussians {
  const harmless = { ...cloud, positions: cloud.positions.map(() => 0), scales: cloud.scales.map(() => 1) };
  const blank = {
    ...harmless,
    rotations: cloud.rotations.map(() => 1),
    opacities: cloud.opacities.map(() => 1),
    sh: cloud.sh.map(() => 0),
  };
  const packed = packGaussians(blank);
  const geometry = new Float32Array(packed.geometry.buffer);
  const stride = layouts.PackedGaussian.size / 4;
  for (let i = 0; i < cloud.count; i++) {
    geometry.set(cloud.positions.subarray(3 * i, 3 * i + 3), stride * i);
    geometry[stride * i + 3] = cloud.opacities[i];
    geometry.set(cloud.rotations.subarray(4 * i, 4 * i + 4), stride * i + 4);
    geometry.set(cloud.scales.subarray(3 * i, 3 * i + 3), stride * i + 8);
  }
  return packed;
}

export const projectionCases: readonly StageCase[] = [
  ...geometryCases,
  {
    name: 'cull: refuses and counts splats with unusable geometry, and decides the others as without them',
    run: async (bench) => {
      const { cloud, cameras } = offCentre();
      const hostile = withHostileSplats(cloud);
      const isGeometry = (fault: string): boolean => !fault.startsWith('sh');
      const alone = await cullOnGpu(bench, packGaussians(cloud), cameras[0]);
      const mixed = await cullOnGpu(bench, packUnchecked(hostile.cloud), cameras[0]);
      hostile.good.forEach((index, i) => check(mixed.visible[index] === alone.visible[i], `good splat ${i} changed`));
      const refused = hostile.bad.filter(({ fault }) => isGeometry(fault));
      for (const { index, fault } of refused) check(!mixed.visible[index], `splat ${index} (${fault}) was drawn`);
      check(mixed.unusable === refused.length, `${mixed.unusable} refused, expected ${refused.length}`);
    },
  },
];
