import { multiply, type Camera, type Matrix4, type Vector3 as Point } from '@gaussian-splat/core';
import { SceneDepth, type FrameTarget } from '@gaussian-splat/renderer';
import type { ProbeAnswer, ProbePoint } from '@gaussian-splat/renderer/tools';
import {
  Camera as ThreeCamera,
  DepthTexture,
  DynamicLighting,
  FloatType,
  HalfFloatType,
  Raycaster,
  RenderTarget,
  Scene,
  Vector3,
  WebGPUCoordinateSystem,
  WebGPURenderer,
  type CubeRenderTarget,
  type Group,
  type Material,
  type Mesh,
  type RenderItem,
  type RenderObject,
} from './three.js';
import type { ViewerFrame } from '../../viewer/camera/orbit.js';
import type { MeshModel } from '../../gpu/loaded-gaussians.js';
import type { Frame } from '../generator/frame-filter.js';
import { matrixOfFrame, transposed } from '../../viewer/camera/placing.js';
import type { PlacedModel } from './meshes.js';
import type { Model } from './model.js';
import { makeEnvironment } from './environment.js';
import { MeshResolve } from './mesh-resolve.js';
import { light, showAsDisplayed, showThrough } from './shown-colors.js';

/** Number of samples per pixel. */
const SAMPLES = 4;
/** Maximum number of lights of each kind, of all meshes of an element. Each file has at most 16. */
const MAX_LIGHTS = 128;

/** Kinds of triangles, which are drawn in this order. Each is a layer number of three.js. */
const [OPAQUE, TRANSPARENT] = [0, 1];

/**
 * Passes of transparent surfaces. A surface that writes depth hides those that are drawn after it, so colors are blended
 * from back to front without that. Before them, nearly opaque parts hide what is behind them. After them, all write depth,
 * because each splat is drawn either in front of the nearest surface or behind it.
 */
const GLASS_PASSES: Readonly<Record<string, Partial<Material>>> = {
  solid: { depthWrite: true, alphaTest: 0.99, forceSinglePass: true },
  colors: { depthWrite: false },
  depth: { depthWrite: true, colorWrite: false, forceSinglePass: true },
};

/** Result of drawing one kind of triangles: `color` is three.js's texture, `texture` has one depth per pixel. */
interface Drawn {
  readonly color: GPUTexture;
  readonly texture: GPUTexture;
}

/** Result of a ray cast. `mesh` and `material` are the names in the file, empty if there are none. */
export interface MeshHit {
  readonly model: MeshModel;
  readonly mesh: string;
  readonly material: string;
}

/**
 * Draws meshes with three.js on the element's device, as layers of color and depth that the splats are blended with.
 */
export class MeshLayer {
  readonly device: GPUDevice;
  readonly #renderer: WebGPURenderer;
  readonly #scene = new Scene();
  readonly #camera = new ThreeCamera();
  readonly #target = new RenderTarget(1, 1, { type: HalfFloatType, samples: SAMPLES });
  /**
   * Target of transparent surfaces that no opaque surface hides. Its depth buffer starts with the depth of the opaque
   * surfaces.
   */
  readonly #glass = new RenderTarget(1, 1, { type: HalfFloatType, samples: SAMPLES });
  readonly #resolve: MeshResolve;
  readonly #center = new Vector3();
  readonly #glassPasses: readonly RenderObject[];
  #depth: { readonly key: readonly unknown[]; readonly ofSplats: SceneDepth } | undefined;
  /** Projection of the camera of the last frame. */
  #drawnFrom: Pick<Camera, 'near' | 'far' | 'orthographic'> = { near: 1, far: Infinity };
  readonly #shown = new Map<Model, Group>();
  readonly #environment: CubeRenderTarget;
  #size = '1 x 1';
  /** The running compilation. It uses the targets until it ends. */
  #compiling: Promise<unknown> | undefined;

  private constructor(device: GPUDevice, renderer: WebGPURenderer, environment: CubeRenderTarget) {
    this.device = device;
    this.#renderer = renderer;
    this.#environment = environment;
    this.#resolve = new MeshResolve(device);
    this.#target.depthTexture = new DepthTexture(1, 1, FloatType);
    this.#glass.depthTexture = this.#target.depthTexture;
    this.#camera.matrixAutoUpdate = false;
    this.#camera.coordinateSystem = WebGPUCoordinateSystem;
    this.#camera._reversedDepth = true;
    // three.js sorts by the depth of clip space, which this projection keeps constant.
    renderer.setTransparentSort((a, b) => this.#nearness(a) - this.#nearness(b));
    this.#glassPasses = Object.entries(GLASS_PASSES).map(([name, own]): RenderObject => (...of) => {
      const material = of[4];
      const { depthWrite, colorWrite, alphaTest, forceSinglePass } = material;
      if (own.alphaTest && material.alphaTestNode) return;
      Object.assign(material, own);
      renderer.renderObject(...of, name);
      Object.assign(material, { depthWrite, colorWrite, alphaTest, forceSinglePass });
    });
  }

  static async create(device: GPUDevice): Promise<MeshLayer> {
    const { onuncapturederror } = device;
    const renderer = new WebGPURenderer({
      device,
      canvas: new OffscreenCanvas(1, 1),
      reversedDepthBuffer: true,
      alpha: true,
    });
    // The element handles a lost device itself, and errors of the page's device belong to the page.
    renderer.onDeviceLost = () => undefined;
    await renderer.init();
    device.onuncapturederror = onuncapturederror;
    renderer.setClearColor(0, 0);
    renderer.lighting = new DynamicLighting({
      ...{ maxDirectionalLights: MAX_LIGHTS, maxPointLights: MAX_LIGHTS, maxSpotLights: MAX_LIGHTS },
    });
    return new MeshLayer(device, renderer, await makeEnvironment(device, renderer));
  }

  /**
   * Compiles the materials of a model without blocking: for a few milliseconds at a time on the main thread, and
   * asynchronously on the GPU.
   */
  async compile(model: Model): Promise<void> {
    const compiling = (this.#compiling = this.#compile(model));
    try {
      await compiling;
    } finally {
      if (this.#compiling === compiling) this.#compiling = undefined;
    }
  }

  async #compile(model: Model): Promise<void> {
    this.#show(model);
    for (const [kind, target] of [
      [OPAQUE, this.#target],
      [TRANSPARENT, this.#glass],
    ] as const) {
      this.#camera.layers.set(kind);
      for (const pass of this.#passesOf(kind)) {
        this.#renderer.setRenderTarget(target);
        this.#renderer.setRenderObjectFunction(pass);
        // compileAsync collects the objects before its first await. Culling is disabled until then, so that no object is
        // missing.
        const culled = model.setCulling(false);
        const compiled = this.#renderer.compileAsync(this.#scene, this.#camera);
        model.setCulling(culled);
        await compiled;
      }
    }
  }

  draw({ camera, depth }: Frame, models: readonly PlacedModel[], world: ViewerFrame): Partial<FrameTarget> {
    this.#arrange(models, world);
    this.#look(camera, world);
    const { width, height } = camera;
    const size = `${width} x ${height}`;
    if (size !== this.#size) this.#resize(width, height);
    this.#size = size;
    this.#drawnFrom = camera;
    const opaque = this.#drawKind(OPAQUE, this.#target);
    const hasGlass = models.some(({ model }) => (model as Model).materials.some(({ transparent }) => transparent));
    const glass = hasGlass ? this.#drawKind(TRANSPARENT, this.#glass) : undefined;
    return { depth: this.#depthFor(opaque, glass, depth?.out) };
  }

  /** Returns the functions that draw the objects of a kind, one for each pass; null for three.js's own. */
  #passesOf(kind: number): readonly (RenderObject | null)[] {
    return kind === OPAQUE ? [null] : this.#glassPasses;
  }

  /** Returns the distance of an object in front of the camera, as a negative number. */
  #nearness({ object, geometry: { boundingSphere } }: RenderItem): number {
    const center = boundingSphere ? this.#center.copy(boundingSphere.center) : this.#center.set(0, 0, 0);
    return center.applyMatrix4(object.matrixWorld).applyMatrix4(this.#camera.matrixWorldInverse).z;
  }

  #resize(width: number, height: number): void {
    for (const target of [this.#target, this.#glass]) {
      target.setSize(width, height);
      // Pipelines need the formats of the textures, which three.js would otherwise create only with the next frame.
      if (this.#compiling) this.#renderer.initRenderTarget(target);
    }
  }

  /** Draws the triangles of one kind. Opaque triangles are drawn first, and hide transparent ones behind them. */
  #drawKind(kind: number, target: RenderTarget): Drawn {
    const renderer = this.#renderer;
    this.#camera.layers.set(kind);
    renderer.autoClearDepth = kind === OPAQUE;
    renderer.setRenderTarget(target);
    for (const pass of this.#passesOf(kind)) {
      renderer.setRenderObjectFunction(pass);
      renderer.render(this.#scene, this.#camera);
      renderer.autoClear = false;
    }
    renderer.autoClear = true;
    const color = renderer.backend.get(target.texture).texture!;
    const samples = renderer.backend.get(target.depthTexture!).texture!;
    return { color, texture: this.#resolve.run(kind, samples) };
  }

  /**
   * Returns the probe answers, corrected for meshes: the depth of a mesh in front of the splats, and transmittance 0
   * for a requested depth behind a mesh.
   */
  async probe(points: readonly ProbePoint[], answers: readonly ProbeAnswer[]): Promise<readonly ProbeAnswer[]> {
    const { width = 0, height = 0 } = this.#resolve.depth ?? {};
    const within = (at: number, size: number): number => Math.min(size - 1, Math.max(0, Math.floor(at)));
    const { near: nearPlane, far, orthographic } = this.#drawnFrom;
    const depthOf = (value: number): number =>
      orthographic ? (value > 0 ? far - value * (far - nearPlane) : Infinity) : nearPlane / value;
    const stored = await this.#resolve.read(points.map(({ x, y }) => [within(x, width), within(y, height)]));
    return answers.map((answer, i) => {
      const mesh = depthOf(stored[i]);
      const { depth: asked } = points[i];
      if (asked !== undefined) return mesh < asked ? { ...answer, transmittance: 0 } : answer;
      const layers = answer.layers.map((depth) =>
        depth > 0 && depth < mesh ? depth : Number.isFinite(mesh) ? mesh : 0,
      );
      if (mesh >= (answer.depth ?? Infinity)) return { ...answer, layers, far: Math.min(answer.far ?? mesh, mesh) };
      const near = Math.min(answer.near ?? mesh, mesh);
      return { ...answer, layers, thickness: 0, near, depth: mesh, far: mesh, transmittance: 0, splat: null };
    });
  }

  /**
   * Returns the first triangle of the last frame that a ray hits; null if there is none. Origin and direction in viewer
   * space.
   */
  hit(origin: Point, direction: Point): MeshHit | null {
    const ray = new Raycaster(new Vector3(...origin), new Vector3(...direction));
    ray.layers.enableAll();
    // Lines and points are as thin as they are drawn.
    ray.params.Line.threshold = ray.params.Points.threshold = 0;
    let first: (MeshHit & { readonly distance: number }) | null = null;
    for (const [model, root] of this.#shown) {
      const [met] = ray.intersectObject(root, true);
      if (!met || met.distance >= (first?.distance ?? Infinity)) continue;
      const { object, face, distance } = met;
      const material = [(object as Mesh).material].flat()[face?.materialIndex ?? 0];
      first = { model, mesh: object.name, material: material?.name ?? '', distance };
    }
    return first;
  }

  /** Frees the GPU memory, when a running compilation has ended. */
  destroy(): void {
    const free = (): void => this.#free();
    if (this.#compiling) void this.#compiling.then(free, free);
    else free();
  }

  #free(): void {
    for (const group of this.#shown.values()) this.#scene.remove(group);
    this.#environment.dispose();
    this.#target.depthTexture?.dispose();
    this.#target.dispose();
    this.#glass.dispose();
    this.#resolve.destroy();
    this.#depth?.ofSplats.destroy();
    void this.#renderer.dispose();
  }

  /**
   * Returns the depth test of the splats against the meshes, which is created again only if a texture changes.
   * @param out Texture that receives the depth of the splats.
   */
  #depthFor(opaque: Drawn, second: Drawn | undefined, out: GPUTexture | undefined): SceneDepth {
    const { orthographic } = this.#drawnFrom;
    const far = orthographic ? this.#drawnFrom.far : Infinity;
    const key = [opaque.color, opaque.texture, second?.color, second?.texture, out, far];
    if (!this.#depth?.key.every((value, i) => value === key[i])) {
      this.#depth?.ofSplats.destroy();
      const ofSplats = new SceneDepth(this.device, { host: { ...opaque, second, reversed: true, far }, out });
      this.#depth = { key, ofSplats };
    }
    return this.#depth.ofSplats;
  }

  /** Adds, removes and places models in three.js's scene. Its space is viewer space, in which the lights are fixed. */
  #arrange(models: readonly PlacedModel[], world: ViewerFrame): void {
    const toViewer = matrixOfFrame(world);
    for (const [model, root] of this.#shown) {
      if (models.some((placed) => placed.model === model)) continue;
      this.#scene.remove(root);
      this.#shown.delete(model);
    }
    for (const { model: known, toWorld } of models) {
      const model = known as Model;
      this.#show(model);
      const { root } = model;
      root.matrixAutoUpdate = false;
      root.matrix.fromArray(transposed(multiply(toViewer, toWorld)));
    }
    this.#scene.updateMatrixWorld(true);
  }

  #show(model: Model): void {
    if (this.#shown.has(model)) return;
    this.#shown.set(model, model.root);
    this.#scene.add(model.root);
    model.root.traverse((object) => object.layers.enableAll());
    model.forEachMesh((mesh, materials) => {
      materials.forEach(showThrough);
      materials.forEach(showAsDisplayed);
      const isGlass = materials.some(({ transparent }) => transparent);
      mesh.layers.set(isGlass ? TRANSPARENT : OPAQUE);
      for (const material of isGlass ? materials : []) material.alphaTest = Math.max(material.alphaTest, 1 / 255);
    });
    if (model.hasLights) return;
    for (const material of model.materials) light(material, this.#environment.texture);
  }

  #look(camera: Camera, world: ViewerFrame): void {
    const { width, height, fx, fy, cx, cy, near, far, worldToCamera, orthographic } = camera;
    const toScene = transposed(matrixOfFrame(world));
    const view = multiply(GL_AXES, multiply(worldToCamera, toScene));
    this.#camera.matrixWorldInverse.fromArray(transposed(view));
    this.#camera.matrixWorld.copy(this.#camera.matrixWorldInverse).invert();
    this.#camera.matrix.copy(this.#camera.matrixWorld);
    const [scaleX, scaleY] = [(2 * fx) / width, (2 * fy) / height];
    const [offsetX, offsetY] = [1 - (2 * cx) / width, (2 * cy) / height - 1];
    // Depth is near / z: 1 at the near plane, 0 at infinity. An orthographic camera has a depth that falls linearly to
    // 0 at the far plane.
    const projection = orthographic
      ? [
          ...[scaleX, 0, 0, -offsetX],
          ...[0, scaleY, 0, -offsetY],
          ...[0, 0, 1 / (far - near), far / (far - near)],
          ...[0, 0, 0, 1],
        ]
      : [...[scaleX, 0, offsetX, 0], ...[0, scaleY, offsetY, 0], ...[0, 0, 0, near], ...[0, 0, -1, 0]];
    this.#camera.projectionMatrix.fromArray(transposed(projection));
    this.#camera.projectionMatrixInverse.copy(this.#camera.projectionMatrix).invert();
  }
}

/** From the camera's axes (x right, y down, z forward) to those of OpenGL (x right, y up, z backward). */
const GL_AXES: Matrix4 = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1];
