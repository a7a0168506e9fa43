/**
 * Rows of the stability catalog that any viewer of a page can draw: a scene, views, and the requirements for the
 * frames. The names are those of tests/stability. Cameras are pinholes with a central principal point, because peers
 * support no others.
 */
import { cloudOf, repeat } from '../../tests/support/clouds.ts';
import { seededRandom } from '../../tests/support/random.ts';
import { withHostileSplats } from '../../tests/support/hostile.ts';
import { cameraAt, movedBy } from '../../tests/support/scenes.ts';
import { brightColors, opacitySteps } from '../../tests/support/scenes/values.ts';
import { needles } from '../../tests/support/scenes/shapes.ts';
import { room } from '../../tests/support/scenes/room.ts';

const SIZE = { width: 160, height: 120 };
const view = (eye, target, fovXDegrees = 60) => cameraAt(eye, target, { ...SIZE, fovXDegrees });
const color = (random) => [random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)];
const sizes = (random, low, high) => [0, 1, 2].map(() => random.logUniform(low, high));

/** PSNR that frames of 8 bits must reach if 59 dB are required before rounding, which alone limits it to 58.9. */
const ON_DISPLAY = 55;

function ball(seed, count = 3000) {
  const random = seededRandom(seed);
  return cloudOf(
    repeat(count, () => ({
      position: [random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)],
      scale: sizes(random, 0.02, 0.2),
      rotation: random.rotation(),
      opacity: random.uniform(0.1, 0.95),
      color: color(random),
    })),
  );
}

function plane() {
  const random = seededRandom(2);
  return cloudOf(
    repeat(20_000, () => ({
      position: [random.uniform(-2, 2), random.uniform(-1.5, 1.5), 0],
      scale: sizes(random, 0.01, 0.06),
      rotation: random.rotation(),
      opacity: random.uniform(0.2, 1),
      color: color(random),
    })),
  );
}

function largeSplats() {
  const random = seededRandom(3);
  return cloudOf(
    repeat(500, () => ({
      position: [random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2)],
      scale: sizes(random, 0.05, 3),
      rotation: random.rotation(),
      opacity: random.logUniform(0.01, 0.6),
      color: color(random),
    })),
  );
}

function withOutliers() {
  const random = seededRandom(8);
  const near = repeat(2000, () => ({
    position: [random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-0.3, 0.3)],
    scale: sizes(random, 0.02, 0.2),
    rotation: random.rotation(),
    opacity: random.uniform(0.2, 0.9),
    color: color(random),
  }));
  // Nearer than the far plane of 1000 that peers are given, and aside, so that only their depth counts.
  const far = repeat(10, (i) => ({
    position: [-90 + 20 * i, -60, 400],
    scale: 8,
    opacity: 0.9,
    color: [0.2, 0.9, 0.4],
  }));
  return cloudOf([...near, ...far]);
}

const still = (row, title, cloud, views, min = ON_DISPLAY, more = {}) => ({
  row,
  title,
  kind: 'still',
  cloud,
  views,
  least: min,
  ...more,
});

/** A turn of 2 degrees to the right. */
function turned(camera, degrees) {
  const angle = (degrees * Math.PI) / 180;
  const m = Array.from(camera.worldToCamera);
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const row = (a, b) => [0, 1, 2, 3].map((k) => a * m[k] + b * m[8 + k]);
  return { ...camera, worldToCamera: [...row(c, -s), ...m.slice(4, 8), ...row(s, c), 0, 0, 0, 1] };
}

/** All cases; each is made when it is its turn. */
export const CASES = [
  // Reference of the rows: for a peer with another definition of a splat, all rows would differ from the oracle.
  () => still('-', 'an ordinary scene, for comparison', ball(1, 1500), [view([0, 0, -4], [0, 0, 0])]),
  () => {
    const { cloud, cameras } = room();
    const start = { ...cameras[0], ...scaledTo(cameras[0]) };
    return {
      row: 'S1',
      title: 'the first frame after a turn of 2 degrees',
      kind: 'turn',
      cloud,
      views: [start, turned(start, 2)],
      least: ON_DISPLAY,
    };
  },
  () => ({
    row: 'S2',
    title: '20,000 splats on one plane: 8 frames of one view',
    kind: 'flicker',
    cloud: plane(),
    views: [view([0, 0, -4], [0, 0, 0])],
    most: 0,
  }),
  () =>
    still(
      'S3',
      'inside large splats',
      largeSplats(),
      [view([0.3, 0, -0.5], [1.3, 0.2, 0.5], 90), view([-1, 0.1, 0.4], [0, 0.2, 1.4], 90)],
      50,
    ),
  () => still('S4', 'needles', needles().cloud, [view([0, 0, -4], [0, 0, 0])]),
  () => {
    const clean = ball(5, 1500);
    return still(
      'S5',
      'NaN, infinities and zero quaternions among 1,500 splats',
      withHostileSplats(clean).cloud,
      [view([0, 0, -4], [0, 0, 0])],
      ON_DISPLAY,
      { truth: clean },
    );
  },
  () => still('S6', 'opacities from 0 to 1', opacitySteps().cloud, [view([0, 0, -4], [0, 0, 0], 70)]),
  () => still('S6', 'colors below 0 and above 1', brightColors().cloud, [view([0.5, -0.8, -3.5], [0, 0, 0], 70)]),
  () => {
    const offset = [1_000_000, -2_000_000, 1_000_000];
    const cloud = ball(7, 1500);
    const far = { ...cloud, positions: cloud.positions.map((x, i) => x + offset[i % 3]) };
    const near = { ...cloud, positions: far.positions.map((x, i) => x - offset[i % 3]) };
    const camera = view([0.013, 0.007, -4], [0, 0, 0]);
    const { cameras } = movedBy({ name: '', cloud, cameras: [camera] }, offset);
    return still('S7', 'a file with float32 coordinates of a million', far, cameras, ON_DISPLAY, {
      truth: near,
      truthViews: [camera],
    });
  },
  () => still('S8', 'ten splats far behind the scene', withOutliers(), [view([0, 0, -3], [0, 0, 0])]),
  () => still('S19', 'a field of view of 150 degrees', ball(19, 1500), [view([0, 0, -1.4], [0, 0, 0], 150)]),
  () => still('S19', 'a field of view of 5 degrees', ball(19, 1500), [view([0, 0, -30], [0, 0, 0], 5)]),
];

function scaledTo(camera) {
  const s = SIZE.width / camera.width;
  return {
    width: SIZE.width,
    height: SIZE.height,
    fx: camera.fx * s,
    fy: camera.fy * s,
    cx: SIZE.width / 2,
    cy: SIZE.height / 2,
  };
}

/** Splats for the oracle: without those that cannot be drawn. */
export const truthOf = ({ cloud, truth, views, truthViews }) => ({ cloud: truth ?? cloud, views: truthViews ?? views });
