import {
  cameraFromProjection,
  GaussianSplatError,
  registerSceneHost,
  type Camera as SplatCamera,
} from '@gaussian-splat/core';
import { LinearColors, SceneDepth, type FrameSettings } from '@gaussian-splat/renderer';
import { texture, toneMapping, toneMappingExposure } from 'three/tsl';
import {
  DepthTexture,
  FloatType,
  HalfFloatType,
  Matrix4,
  NodeMaterial,
  NoToneMapping,
  QuadMesh,
  RenderTarget,
  Quaternion,
  Vector2,
  Vector3,
  WebGPUCoordinateSystem,
  type Camera,
  type Object3D,
  type Texture,
  type ToneMapping,
  type WebGPURenderer,
} from 'three/webgpu';
import { generatedSplatsHost } from './generated-splats.js';
import { SplatWorld } from './splat-world.js';

export interface SplatRendererOptions {
  /** Settings of frames, as returned by `settings(…)` of `@gaussian-splat/renderer`. */
  readonly settings?: FrameSettings;
  /**
   * Called when a drawn frame has omitted splats because of the buffers' capacity. Draw another frame, for which the
   * capacity suffices.
   */
  readonly onIncomplete?: () => void;
}

/**
 * Draws a three.js scene with the splats in it: each {@link SplatScene} is hidden by meshes in front of it, and hides
 * those behind it.
 *
 * ```ts
 * const renderer = new WebGPURenderer({ canvas });
 * await renderer.init();
 * const splats = new SplatRenderer(renderer);
 * renderer.setAnimationLoop(() => splats.render(scene, camera));
 * ```
 *
 * Transparent meshes are drawn before the splats. Memory is allocated for each camera: {@link dispose} frees it.
 */
export class SplatRenderer {
  readonly #renderer: WebGPURenderer;
  readonly #device: GPUDevice;
  readonly #options: SplatRendererOptions;
  readonly #colors: LinearColors;
  readonly #worlds = new Map<Object3D, Map<Camera, SplatWorld>>();
  readonly #depths = new WeakMap<GPUTexture, Map<boolean, SceneDepth>>();
  readonly #size = new Vector2();
  /** Image with the meshes of a frame, and with the splats unless the renderer has tone mapping. */
  #frame: RenderImage | undefined;
  /**
   * Image with the tone-mapped meshes and the splats, and the curve that it was created for; undefined without tone
   * mapping.
   */
  #mapped: { readonly image: RenderImage; readonly map: Quad; readonly curve: ToneMapping } | undefined;

  /**
   * Creates a renderer of splats for a renderer of three.js.
   * @throws GaussianSplatError `argument/value` for a renderer that is not initialized, or does not use WebGPU.
   */
  constructor(renderer: WebGPURenderer, options: SplatRendererOptions = {}) {
    const { device, isWebGPUBackend = false } = renderer.backend;
    if (!isWebGPUBackend || !device)
      throw wrong(
        'renderer',
        'a WebGPURenderer that draws with WebGPU and is initialized',
        isWebGPUBackend ? 'one that is not initialized' : 'one that draws with WebGL',
        'await renderer.init() first, and see whether the browser has WebGPU',
      );
    this.#renderer = renderer;
    this.#device = device;
    this.#options = options;
    this.#colors = new LinearColors(device);
    registerSceneHost(generatedSplatsHost);
  }

  /**
   * Draws meshes and splats to the renderer's current target: a render target, or the canvas with its tone mapping and
   * color space. Tone mapping applies only to the meshes, because the colors of captured splats already include a tone
   * curve.
   */
  render(scene: Object3D, camera: Camera): void {
    const renderer = this.#renderer;
    const { toneMapping: curve, isOutputTarget } = renderer;
    const before = renderer.getRenderTarget();
    const drawn = this.#frameOf();
    renderer.setRenderTarget(drawn.target);
    renderer.render(scene, camera);
    const shown = isOutputTarget && curve !== NoToneMapping ? this.#map(drawn, curve) : drawn;
    this.#drawInto(scene, camera, shown.target, drawn.target.depthTexture);
    renderer.setRenderTarget(before);
    renderer.toneMapping = NoToneMapping;
    shown.copy.quad.render(renderer);
    renderer.toneMapping = curve;
  }

  /**
   * Draws only the splats over the content of a render target, for your own pipelines: call
   * `renderer.setRenderTarget(target)`, `renderer.render(scene, camera)`, then this. The target must hold linear light
   * with one sample per pixel, and a `depthTexture`; without it splats hide all meshes.
   * @throws GaussianSplatError `argument/value` for another target; `argument/camera` for a camera with a skewed
   * projection.
   */
  draw(scene: Object3D, camera: Camera, target: RenderTarget): void {
    this.#drawInto(scene, camera, target, target.depthTexture);
  }

  #drawInto(scene: Object3D, camera: Camera, target: RenderTarget, stored: DepthTexture | null): void {
    const world = this.#worldOf(scene, camera);
    world.follow(scene, camera);
    if (world.isEmpty) return;
    const view = cameraFromProjection(camera.matrixWorldInverse.elements, camera.projectionMatrix.elements, {
      ...{ width: target.width, height: target.height },
      clipDepth: camera.coordinateSystem === WebGPUCoordinateSystem ? '0..1' : '-1..1',
    });
    const depth = stored ? this.#depthOf(this.#gpu(stored), camera) : undefined;
    const image = { target: this.#gpu(target.texture), background: 'load', colors: this.#colors, depth } as const;
    world.viewpoint.draw(view, image);
  }

  /**
   * Returns the state for a generator whose contract has camera inputs: `models.runGenerators({
   * ...splats.stateOf(camera, model), timeSeconds })`.
   * @param model Object that shows it, because a generator receives the camera in its own coordinates. Default: an
   * object at the origin.
   * @throws GaussianSplatError `argument/camera` for a camera with a skewed projection.
   */
  stateOf(camera: Camera, model?: Object3D): { readonly camera: SplatCamera } {
    camera.updateWorldMatrix(true, false);
    model?.updateWorldMatrix(true, false);
    const toModel = new Matrix4();
    if (model) toModel.copy(model.matrixWorld).invert();
    const place = toModel.multiply(camera.matrixWorld);
    const [position, turn] = [new Vector3(), new Quaternion()];
    place.decompose(position, turn, new Vector3());
    // Only the position is converted by the object's scale; the view matrix has none.
    const view = place.compose(position, turn, new Vector3(1, 1, 1)).invert();
    const { x: width, y: height } = this.#renderer.getDrawingBufferSize(this.#size);
    const clipDepth = camera.coordinateSystem === WebGPUCoordinateSystem ? '0..1' : '-1..1';
    return {
      camera: cameraFromProjection(view.elements, camera.projectionMatrix.elements, { width, height, clipDepth }),
    };
  }

  /** Frees the memory of a camera, or without one of all cameras. Later draws allocate it again. */
  dispose(camera?: Camera): void {
    for (const worlds of this.#worlds.values()) {
      for (const [own, { viewpoint }] of worlds) {
        if (camera !== undefined && own !== camera) continue;
        viewpoint.destroy();
        worlds.delete(own);
      }
    }
    if (camera !== undefined) return;
    this.#colors.destroy();
    disposeImage(this.#frame);
    this.#frame = undefined;
    this.#forgetMapped();
  }

  #worldOf(scene: Object3D, camera: Camera): SplatWorld {
    let worlds = this.#worlds.get(scene);
    if (worlds === undefined) this.#worlds.set(scene, (worlds = new Map<Camera, SplatWorld>()));
    let world = worlds.get(camera);
    if (world === undefined) {
      const { settings = {}, onIncomplete = () => undefined } = this.#options;
      worlds.set(camera, (world = new SplatWorld(this.#device, settings, onIncomplete)));
    }
    return world;
  }

  /** Returns the image that a whole frame is drawn into, in the size of the current target. */
  #frameOf(): RenderImage {
    const { width, height } = this.#renderer.getRenderTarget() ?? drawingBuffer(this.#renderer, this.#size);
    this.#frame ??= imageOf(new DepthTexture(width, height, FloatType));
    this.#frame.target.setSize(width, height);
    return this.#frame;
  }

  /** Applies a tone curve to a frame, and returns the resulting image. */
  #map(drawn: RenderImage, curve: ToneMapping): RenderImage {
    if (this.#mapped?.curve !== curve) {
      this.#forgetMapped();
      const map = quadOf(toneMapping(curve, toneMappingExposure, texture(drawn.target.texture)));
      this.#mapped = { image: imageOf(), map, curve };
    }
    const { image, map } = this.#mapped!;
    image.target.setSize(drawn.target.width, drawn.target.height);
    this.#renderer.setRenderTarget(image.target);
    map.quad.render(this.#renderer);
    return image;
  }

  #forgetMapped(): void {
    this.#mapped?.map.material.dispose();
    disposeImage(this.#mapped?.image);
    this.#mapped = undefined;
  }

  #depthOf(stored: GPUTexture, { reversedDepth = false }: Camera): SceneDepth {
    let known = this.#depths.get(stored);
    if (known === undefined) this.#depths.set(stored, (known = new Map<boolean, SceneDepth>()));
    let depth = known.get(reversedDepth);
    if (depth === undefined) {
      const host = { texture: stored, values: 'device', reversed: reversedDepth } as const;
      known.set(reversedDepth, (depth = new SceneDepth(this.#device, { host })));
    }
    return depth;
  }

  #gpu(of: Texture): GPUTexture {
    const { texture: made } = this.#renderer.backend.get(of);
    if (made === undefined)
      throw wrong(
        'target',
        'a render target that the renderer has drawn into',
        'one without a texture on the GPU',
        'draw the scene into the target first: renderer.setRenderTarget(target); renderer.render(scene, camera)',
      );
    return made;
  }
}

interface Quad {
  readonly material: NodeMaterial;
  readonly quad: QuadMesh;
}

/** An image in linear light, and the material that copies it to the target. */
interface RenderImage {
  readonly target: RenderTarget;
  readonly copy: Quad;
}

function quadOf(colors: NodeMaterial['fragmentNode']): Quad {
  const material = new NodeMaterial();
  material.fragmentNode = colors;
  material.depthTest = false;
  material.depthWrite = false;
  return { material, quad: new QuadMesh(material) };
}

function imageOf(depthTexture: DepthTexture | null = null): RenderImage {
  const target = new RenderTarget(1, 1, { type: HalfFloatType, depthTexture, depthBuffer: depthTexture !== null });
  return { target, copy: quadOf(texture(target.texture)) };
}

function disposeImage(image: RenderImage | undefined): void {
  image?.target.depthTexture?.dispose();
  image?.target.dispose();
  image?.copy.material.dispose();
}

const drawingBuffer = (renderer: WebGPURenderer, size: Vector2): { width: number; height: number } => {
  const { x, y } = renderer.getDrawingBufferSize(size);
  return { width: x, height: y };
};

const wrong = (where: string, expected: string, found: string, remedy: string): GaussianSplatError =>
  new GaussianSplatError('argument/value', { where: `SplatRenderer.${where}`, expected, found, remedy });
