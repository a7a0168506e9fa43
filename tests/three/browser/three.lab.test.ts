/** Splats in three.js's own canvas, on its device: as the renderer draws them alone, and hidden by nearer meshes. */
import { cameraFromProjection, type GaussianCloud } from '@gaussian-splat/core';
import {
  capture,
  GaussianBuffers,
  packGaussians,
  settings,
  Viewpoint,
  World,
  type RasterizerName,
} from '@gaussian-splat/renderer';
import { GaussianModels } from '@gaussian-splat/generator';
import { type GeneratedSplats, SplatRenderer, SplatScene } from '@gaussian-splat/three';
import {
  ACESFilmicToneMapping,
  BoxGeometry,
  Color,
  Mesh,
  MeshBasicMaterial,
  NoToneMapping,
  OrthographicCamera,
  PerspectiveCamera,
  Scene,
  WebGPURenderer,
} from 'three/webgpu';
import { assert } from '../../element/browser/support/harness.js';
import { isLab } from '../../support/extent-in-pages.js';
import { FIXTURES as GENERATORS } from '../../generator/browser/support.js';

const [WIDTH, HEIGHT] = [192, 128];
const BACKGROUND = [0.1, 0.3, 0.2] as const;

/** A wall of faint and opaque balls that faces the z axis; y up. */
function wall(): GaussianCloud {
  const [columns, rows] = [24, 16];
  const count = columns * rows;
  const fill = (width: number, value: (i: number, k: number) => number): Float32Array =>
    Float32Array.from({ length: width * count }, (_, n) => value(Math.floor(n / width), n % width));
  return {
    ...{ count, shDegree: 0, antialiased: false, origin: [0, 0, 0], droppedCount: 0 },
    positions: fill(3, (i, k) => [((i % columns) - 11.5) / 8, (Math.floor(i / columns) - 7.5) / 8, 0.002 * (i % 7)][k]),
    scales: fill(3, () => 0.06),
    rotations: fill(4, (_, k) => (k === 0 ? 1 : 0)),
    opacities: fill(1, (i) => (i % columns < 12 ? 0.99 : 0.5)),
    sh: fill(3, (i, k) => 1.5 * Math.sin(i + 2 * k)),
  };
}

async function renderer3(antialias = false) {
  const canvas = document.createElement('canvas');
  document.body.append(canvas);
  const renderer = new WebGPURenderer({ canvas, antialias });
  renderer.setSize(WIDTH, HEIGHT, false);
  await renderer.init();
  return { renderer, canvas };
}

/** Pixels of a canvas, read in the task that drew it. */
function shown(canvas: HTMLCanvasElement): Uint8ClampedArray {
  const context = new OffscreenCanvas(WIDTH, HEIGHT).getContext('2d')!;
  context.drawImage(canvas, 0, 0);
  return context.getImageData(0, 0, WIDTH, HEIGHT).data;
}

const at = (pixels: ArrayLike<number>, x: number, y: number): number[] =>
  [0, 1, 2].map((k) => pixels[4 * (WIDTH * y + x) + k]);

const worst = (a: ArrayLike<number>, b: ArrayLike<number>): number => {
  let max = 0;
  for (let i = 0; i < a.length; i++) if (i % 4 < 3) max = Math.max(max, Math.abs(a[i] - b[i]));
  return max;
};

/** Many frames: room is learnt. */
const FRAMES = 3;

describe('splats in a three.js scene', () => {
  // SwiftShader takes 20 s to compile tiles on a device of three's.
  const rasterizers: readonly RasterizerName[] = isLab ? ['quads', 'tiles'] : ['quads'];
  for (const rasterizer of rasterizers) {
    it(`${rasterizer}: on three's canvas as the renderer draws them, and a bar through them is hidden where it is behind`, async () => {
      const { renderer, canvas } = await renderer3();
      const device = renderer.backend.device!;
      device.pushErrorScope('validation');
      const how = settings('default', { rasterizer });
      const gaussians = await GaussianBuffers.upload(device, packGaussians(wall()));
      const splats = new SplatRenderer(renderer, { settings: how });
      const scene = new Scene();
      scene.background = new Color().setRGB(...BACKGROUND, 'srgb');
      const placed = new SplatScene(gaussians);
      placed.position.set(0.2, -0.1, 0);
      placed.rotation.set(0.1, 0.4, 0.05);
      placed.scale.setScalar(0.8);
      scene.add(placed);
      const perspective = new PerspectiveCamera(50, WIDTH / HEIGHT, 0.1, 100);
      perspective.position.set(0.3, 0.2, 2.6);
      perspective.lookAt(0, 0, 0);
      const parallel = new OrthographicCamera(-1.8, 1.8, 1.2, -1.2, 0.1, 100);
      parallel.position.set(-0.4, 0.3, 3);
      parallel.lookAt(0, 0, 0);
      for (const camera of [perspective, parallel]) {
        splats.render(scene, camera);
        const world = new World();
        const matrix: number[] = placed.matrixWorld.elements;
        const sceneToWorld = matrix.map((_, k) => matrix[4 * (k % 4) + Math.floor(k / 4)]);
        world.add({ scene: gaussians, sceneToWorld });
        const view = cameraFromProjection(camera.matrixWorldInverse.elements, camera.projectionMatrix.elements, {
          width: WIDTH,
          height: HEIGHT,
        });
        const alone = new Viewpoint(device, world, { settings: how });
        const expected = await capture(device, alone, { camera: view, background: [...BACKGROUND, 1] });
        for (let k = 0; k < FRAMES; k++) splats.render(scene, camera);
        const found = shown(canvas);
        const bytes = expected.map((value) => Math.round(255 * Math.min(1, value)));
        assert(worst(found, bytes) <= 1, `${rasterizer}: ${worst(found, bytes)} / 255`);
        alone.destroy();
      }

      // The bar stands across the wall: its left end in front, its right end behind.
      placed.position.set(0, 0, 0);
      placed.rotation.set(0, 0, 0);
      const bar = new Mesh(new BoxGeometry(2.2, 0.2, 0.05), new MeshBasicMaterial({ color: 0xff2000 }));
      bar.rotation.y = 0.5;
      scene.add(bar);
      perspective.position.set(0, 0, 2.6);
      perspective.lookAt(0, 0, 0);
      splats.render(scene, perspective);
      splats.render(scene, perspective);
      const crossed = shown(canvas);
      placed.visible = false;
      splats.render(scene, perspective);
      const barAlone = shown(canvas);
      placed.visible = true;
      bar.visible = false;
      splats.render(scene, perspective);
      const wallAlone = shown(canvas);
      const isNear = (a: number[], b: number[], max: number): boolean => a.every((v, k) => Math.abs(v - b[k]) <= max);
      const y = HEIGHT / 2;
      // The end at -x moves towards the viewer or away with rotation.y; in either case one is in front.
      const [left, right] = [WIDTH / 2 - 30, WIDTH / 2 + 30];
      const [front, back] = isNear(at(crossed, left, y), at(barAlone, left, y), 1) ? [left, right] : [right, left];
      assert(isNear(at(barAlone, front, y), [255, 32, 0], 2), `the bar is visible: ${at(barAlone, front, y)}`);
      assert(isNear(at(crossed, front, y), at(barAlone, front, y), 1), `in front: ${at(crossed, front, y)}`);
      assert(!isNear(at(crossed, back, y), at(barAlone, back, y), 30), `behind: ${at(crossed, back, y)}`);
      if (back < WIDTH / 2) assert(isNear(at(crossed, back, y), at(wallAlone, back, y), 4), 'the opaque half hides it');

      // A tone curve is for meshes: splats have one in their colors.
      renderer.toneMapping = ACESFilmicToneMapping;
      bar.visible = true;
      placed.visible = false;
      splats.render(scene, perspective);
      const mapped = shown(canvas);
      assert(worst(mapped, barAlone) > 20, 'the bar has the tone curve');
      placed.visible = true;
      splats.render(scene, perspective);
      const together = shown(canvas);
      assert(isNear(at(together, front, y), at(mapped, front, y), 1), 'the bar is as without splats');
      bar.visible = false;
      splats.render(scene, perspective);
      // Half of the wall is opaque: no background, which has the curve, shows through.
      const [x, above] = [WIDTH / 2 - 30, HEIGHT / 2 - 20];
      assert(isNear(at(shown(canvas), x, above), at(wallAlone, x, above), 2), `splats: ${at(shown(canvas), x, above)}`);
      renderer.toneMapping = NoToneMapping;

      // Hiding, and a second camera, do not change the first one's image.
      bar.visible = true;
      splats.render(scene, parallel);
      splats.render(scene, perspective);
      assert(worst(shown(canvas), crossed) <= 1, 'after another camera as before');
      scene.remove(placed);
      splats.render(scene, perspective);
      assert(worst(shown(canvas), barAlone) <= 1, 'removed from the graph, absent from the frame');
      const error = await device.popErrorScope();
      assert(error === null, error?.message ?? '');
      splats.dispose();
      gaussians.destroy();
      renderer.dispose();
      canvas.remove();
    });
  }

  it('a model by name: its splats stand in the scene, as its last run has written them', async () => {
    const { renderer, canvas } = await renderer3();
    const device = renderer.backend.device!;
    const models = new GaussianModels();
    models.registerGaussianGenerator('ball', { url: `${GENERATORS}packed.onnx` });
    await models.loadAllGenerators(device);
    const how = settings('default', { rasterizer: 'quads' });
    const splats = new SplatRenderer(renderer, { settings: how });
    const scene = new Scene();
    scene.background = new Color().setRGB(...BACKGROUND, 'srgb');
    const camera = new PerspectiveCamera(50, WIDTH / HEIGHT, 0.1, 100);
    camera.position.set(0, 0, 6);
    const draw = (): Uint8ClampedArray => {
      for (let k = 0; k < FRAMES; k++) splats.render(scene, camera);
      return shown(canvas);
    };
    const nothing = draw();
    const model = await models.addGaussianModelToScene('ball', scene);
    const ball = model.gaussians as GeneratedSplats;
    assert(scene.children.includes(ball), 'in the graph');
    assert(worst(draw(), nothing) === 0, 'nothing before the first run');
    models.runGenerators({ timeSeconds: 1 });
    await model.generator.idle;
    const first = draw();
    assert(worst(first, nothing) > 40, `the ball is seen: ${worst(first, nothing)}`);
    const twin = new SplatScene(ball.gaussians);
    scene.remove(ball);
    scene.add(twin);
    assert(worst(draw(), first) === 0, 'as its Gaussians are drawn alone');
    scene.remove(twin);
    scene.add(ball);
    ball.position.set(1, 0, 0);
    assert(worst(draw(), first) > 40, 'its matrix moves it');
    ball.position.set(0, 0, 0);
    const before = ball.version;
    models.runGenerators({ timeSeconds: 2 });
    await model.generator.idle;
    assert(ball.version === before + 1, 'another run is taken in');
    const moved = splats.stateOf(camera, ball).camera.worldToCamera;
    ball.position.set(1, 0, 0);
    ball.scale.setScalar(2);
    const own = splats.stateOf(camera, ball).camera.worldToCamera;
    const eye = (m: ArrayLike<number>): number[] =>
      [0, 1, 2].map((k) => -(m[k] * m[3] + m[4 + k] * m[7] + m[8 + k] * m[11]));
    const wanted = eye(moved).map((x, k) => (x - (k === 0 ? 1 : 0)) / 2);
    assert(
      eye(own).every((x, k) => Math.abs(x - wanted[k]) < 1e-6),
      `the eye in its own frame: ${eye(own).join(' ')}`,
    );
    model.remove();
    assert(worst(draw(), nothing) === 0, 'absent from the graph and from the frame');
    models.clear();
    splats.dispose();
    renderer.dispose();
    canvas.remove();
  });

  it('names what a renderer lacks', () => {
    let code = '';
    try {
      new SplatRenderer(new WebGPURenderer());
    } catch (error) {
      code = (error as { code: string }).code;
    }
    assert(code === 'argument/value', code);
  });
});
