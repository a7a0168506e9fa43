import { multiply, type Camera, type Matrix4 } from '@gaussian-splat/core';
import { SceneDepth, type FrameTarget, type ProbeAnswer, type ProbePoint } from '@gaussian-splat/renderer';
import {
  Camera as ThreeCamera,
  DepthTexture,
  FloatType,
  HalfFloatType,
  PMREMGenerator,
  RenderTarget,
  RoomEnvironment,
  Scene,
  WebGPUCoordinateSystem,
  WebGPURenderer,
  type Group,
} from './three.js';
import type { ViewerFrame } from '../camera/orbit.js';
import type { Frame } from '../live/frame-filter.js';
import { matrixOfFrame, transposed } from '../composition/placing.js';
import type { PlacedModel } from './meshes.js';
import type { Model } from './model.js';
import { MeshResolve } from './mesh-resolve.js';
import { light, showAsDisplayed } from './shown-colors.js';

/** Samples of a pixel. */
const SAMPLES = 4;

/** Draws meshes with three.js on the element's device, into the frame and a depth texture that splats end at. */
export class MeshLayer {
  readonly device: GPUDevice;
  readonly #renderer: WebGPURenderer;
  readonly #scene = new Scene();
  readonly #camera = new ThreeCamera();
  readonly #target = new RenderTarget(1, 1, { type: HalfFloatType, samples: SAMPLES });
  readonly #resolve: MeshResolve;
  #depth: { readonly texture: GPUTexture; readonly ofSplats: SceneDepth } | undefined;
  /** Near plane of the last frame. */
  #near = 1;
  readonly #shown = new Map<Model, Group>();
  #environment: RenderTarget | undefined;
  #size = '1 x 1';

  private constructor(device: GPUDevice, renderer: WebGPURenderer) {
    this.device = device;
    this.#renderer = renderer;
    this.#resolve = new MeshResolve(device);
    this.#target.depthTexture = new DepthTexture(1, 1, FloatType);
    this.#camera.matrixAutoUpdate = false;
    this.#camera.coordinateSystem = WebGPUCoordinateSystem;
    this.#camera._reversedDepth = true;
  }

  static async create(device: GPUDevice): Promise<MeshLayer> {
    const { onuncapturederror } = device;
    const renderer = new WebGPURenderer({
      device,
      canvas: new OffscreenCanvas(1, 1),
      reversedDepthBuffer: true,
      alpha: true,
    });
    // The element knows of losses itself, and the device is the page's: whose errors are its own.
    renderer.onDeviceLost = () => undefined;
    await renderer.init();
    device.onuncapturederror = onuncapturederror;
    renderer.setClearColor(0, 0);
    return new MeshLayer(device, renderer);
  }

  draw(
    { camera, target, background }: Frame,
    models: readonly PlacedModel[],
    world: ViewerFrame,
  ): Partial<FrameTarget> {
    this.#arrange(models, world);
    this.#look(camera, world);
    const { width, height } = camera;
    const size = `${width} x ${height}`;
    if (size !== this.#size) this.#target.setSize(width, height);
    this.#size = size;
    this.#renderer.setRenderTarget(this.#target);
    this.#renderer.render(this.#scene, this.#camera);
    const { backend } = this.#renderer;
    const color = backend.get(this.#target.texture).texture!;
    const depth = backend.get(this.#target.depthTexture!).texture!;
    this.#near = camera.near;
    return { over: 'target', depth: this.#depthFor(this.#resolve.run(color, depth, target, background)) };
  }

  /** Ends what was found of splats where a mesh is nearer. */
  async probe(points: readonly ProbePoint[], answers: readonly ProbeAnswer[]): Promise<readonly ProbeAnswer[]> {
    const { width = 0, height = 0 } = this.#resolve.depth ?? {};
    const within = (at: number, size: number): number => Math.min(size - 1, Math.max(0, Math.floor(at)));
    const near = this.#near;
    const stored = await this.#resolve.read(points.map(({ x, y }) => [within(x, width), within(y, height)]));
    return answers.map((answer, i) => {
      const mesh = near / stored[i];
      const { depth: asked } = points[i];
      if (asked !== undefined) return mesh < asked ? { ...answer, transmittance: 0 } : answer;
      if (mesh >= (answer.depth ?? Infinity)) return { ...answer, far: Math.min(answer.far ?? mesh, mesh) };
      return { ...answer, near: Math.min(answer.near ?? mesh, mesh), depth: mesh, far: mesh, transmittance: 0 };
    });
  }

  destroy(): void {
    for (const group of this.#shown.values()) this.#scene.remove(group);
    this.#environment?.dispose();
    this.#target.depthTexture?.dispose();
    this.#target.dispose();
    this.#resolve.destroy();
    this.#depth?.ofSplats.destroy();
    void this.#renderer.dispose();
  }

  /** Bound once for the same texture. */
  #depthFor(texture: GPUTexture): SceneDepth {
    if (this.#depth?.texture !== texture) {
      this.#depth?.ofSplats.destroy();
      const ofSplats = new SceneDepth(this.device, { host: { texture, reversed: true, far: Infinity } });
      this.#depth = { texture, ofSplats };
    }
    return this.#depth.ofSplats;
  }

  /** Puts models where they are, in viewer space, which is that of lights. */
  #arrange(models: readonly PlacedModel[], world: ViewerFrame): void {
    const toViewer = matrixOfFrame(world);
    for (const [model, root] of this.#shown) {
      if (models.some((placed) => placed.model === model)) continue;
      this.#scene.remove(root);
      this.#shown.delete(model);
    }
    for (const { model: known, toWorld } of models) {
      const model = known as Model;
      if (!this.#shown.has(model)) this.#show(model);
      const { root } = model;
      root.matrixAutoUpdate = false;
      root.matrix.fromArray(transposed(multiply(toViewer, toWorld)));
    }
    this.#scene.updateMatrixWorld(true);
  }

  #show(model: Model): void {
    this.#shown.set(model, model.root);
    this.#scene.add(model.root);
    model.materials.forEach(showAsDisplayed);
    if (model.hasLights) return;
    const { texture } = (this.#environment ??= this.#makeEnvironment());
    for (const material of model.materials) light(material, texture);
  }

  /** Even light from all around: the room of model-viewer. */
  #makeEnvironment(): RenderTarget {
    const generator = new PMREMGenerator(this.#renderer);
    const room = new RoomEnvironment();
    const environment = generator.fromScene(room, 0.04, 0.1, 100, { size: 128 });
    room.dispose();
    generator.dispose();
    return environment;
  }

  #look({ width, height, fx, fy, cx, cy, near, worldToCamera }: Camera, world: ViewerFrame): void {
    const toScene = transposed(matrixOfFrame(world));
    const view = multiply(GL_AXES, multiply(worldToCamera, toScene));
    this.#camera.matrixWorldInverse.fromArray(transposed(view));
    this.#camera.matrixWorld.copy(this.#camera.matrixWorldInverse).invert();
    this.#camera.matrix.copy(this.#camera.matrixWorld);
    // Depth is near / z: 1 at the near plane, 0 infinitely far.
    const projection = [
      ...[(2 * fx) / width, 0, 1 - (2 * cx) / width, 0],
      ...[0, (2 * fy) / height, (2 * cy) / height - 1, 0],
      ...[0, 0, 0, near],
      ...[0, 0, -1, 0],
    ];
    this.#camera.projectionMatrix.fromArray(transposed(projection));
    this.#camera.projectionMatrixInverse.copy(this.#camera.projectionMatrix).invert();
  }
}

/** From a camera's axes (x right, y down, z forward) to those of OpenGL. */
const GL_AXES: Matrix4 = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1];
