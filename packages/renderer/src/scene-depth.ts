import { GaussianSplatError, type Camera } from '@gaussian-splat/core';
import {
  blendLayers,
  rasterizeQuadsDepth,
  rasterizeTilesDepth,
  rasterizeTilesDepthFew,
} from './generated/depth-shaders.js';
import { constants, layouts } from './generated/shaders.js';
import { deviceReading, type DepthPlanes } from './depth-reading.js';
import { BUFFER_USAGE, perDevice, SHADER_STAGE, ShaderProgram, TEXTURE_USAGE, type Overrides } from './gpu/kernel.js';
import { writeStruct } from './gpu/struct.js';
import type { AuxiliaryOutputs, PaintingDepth, QuadsWithDepth, RasterizerName } from './rasterizers/rasterizer.js';
import { rasterizeKernel } from './rasterizers/tile-kernels.js';
import { BoundImages, type TilePainter } from './rasterizers/tile-painter.js';

/** Depth buffer of a host, whose surfaces hide splats behind them. */
export interface HostDepth extends DepthPlanes {
  /**
   * Depth texture with one sample and the usage TEXTURE_BINDING. Formats: `depth32float`, `depth24plus`,
   * `depth16unorm`, each with or without stencil, or `r32float`. A texture of another size is stretched over the image.
   */
  readonly texture: GPUTexture;
  /**
   * Meaning of the values. `device`: from 0 at the near plane to 1 at the far plane, as GPUs write. `linear`: world
   * units along the optical axis, 0 for no surface. Default: `linear` for `r32float`, otherwise `device`.
   */
  readonly values?: 'device' | 'linear' | undefined;
  /**
   * Layer of color at this depth, which is blended among the splats. Without it pixels end at the depth. Colors are
   * premultiplied, and encoded as those of splats. Alpha is the covered fraction of the pixel, so that antialiased
   * edges show the splats behind. Same size as {@link texture}, usage TEXTURE_BINDING.
   */
  readonly color?: GPUTexture | undefined;
  /**
   * Second layer for transparent surfaces, in front of or behind the first layer at each pixel. Its textures have the
   * formats and the size of those of the first layer.
   */
  readonly second?: { readonly texture: GPUTexture; readonly color: GPUTexture } | undefined;
}

/** Depth input and output of a frame. At least one of the two is required. */
export interface SceneDepthOptions {
  /** Depth of meshes in the frame, which ends pixels of splats. */
  readonly host?: HostDepth | undefined;
  /**
   * Texture that receives the median depth of the splats, in world units along the optical axis: the depth at which
   * their transmittance falls below one half. 0 if more light passes. Same size as the target, format `r32float`, usage
   * STORAGE_BINDING. Frames with fewer pixels fill the upper left corner: {@link SceneDepth.drawn}. Requires the
   * rasterizer `tiles`.
   */
  readonly out?: GPUTexture | undefined;
}

interface Size {
  readonly width: number;
  readonly height: number;
}

/** Size in pixels of the last frame whose depth a texture contains. Several objects may write to one texture. */
const drawnSizes = new WeakMap<GPUTexture, Size>();

const FORMATS = /^(depth(32float|24plus|16unorm)(-stencil8)?|r32float)$/;

/**
 * Depth input and output of a frame. Reuse one object for the same textures, so that they are bound once.
 *
 * ```ts
 * const depth = new SceneDepth(device, { host: { texture: depthTexture } });
 * viewpoint.draw(camera, { target, background: 'load', depth });
 * ```
 *
 * Frames with depth sort their splats by all 32 bits of the depth, and use 8 more bytes for each visible splat. Pages
 * without this class load none of its code.
 */
export class SceneDepth implements PaintingDepth {
  readonly #outTexture: GPUTexture | undefined;
  readonly #device: GPUDevice;
  readonly #host: HostDepth | undefined;
  readonly #stored: GPUTextureView;
  readonly #out: GPUTextureView;
  readonly #uniform: GPUBuffer;
  readonly #bytes = new ArrayBuffer(layouts.SceneDepth.size);
  readonly #tiles = new BoundImages();
  readonly #layerViews: Readonly<Record<'layer_color' | 'second_depth' | 'second_color', GPUTextureView>>;
  #layerBindings: GPUBindGroup | undefined;
  #quads: { readonly key: readonly unknown[]; readonly group: GPUBindGroup } | undefined;

  /**
   * @throws GaussianSplatError `argument/value` for a texture that cannot be read or written, or if both options are
   * missing.
   */
  constructor(device: GPUDevice, { host, out }: SceneDepthOptions) {
    if (!host && !out) throw wrong('SceneDepth', 'host, out or both', 'neither');
    if (host) requireHost(host);
    if (out) requireOut(out);
    this.#device = device;
    this.#host = host;
    this.#outTexture = out;
    this.#stored = host ? viewOf(host.texture) : nothing(device);
    this.#out = (out ?? nowhere(device)).createView();
    this.#layerViews = {
      layer_color: host?.color?.createView() ?? nothing(device),
      second_depth: host?.second ? viewOf(host.second.texture) : nothing(device),
      second_color: host?.second?.color.createView() ?? nothing(device),
    };
    const usage = BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination;
    this.#uniform = device.createBuffer({ label: 'gs.scene_depth', size: layouts.SceneDepth.size, usage });
  }

  /**
   * Checks the textures for a frame, and writes the uniform of its camera.
   * @throws GaussianSplatError `unsupported/limits` for a median depth with the rasterizer `quads`; `argument/value`
   * for an output texture that is too small, or for a frame with auxiliary outputs.
   */
  prepare(
    camera: Camera,
    { width, height }: { readonly width: number; readonly height: number },
    rasterizer: RasterizerName,
    auxiliary: AuxiliaryOutputs | undefined,
  ): void {
    const host = this.#host;
    if (auxiliary) throw wrong('FrameTarget.depth', 'no depth in a frame with auxiliary outputs', 'both');
    const out = this.#outTexture;
    if (out) {
      requireRoom(out, width, height, rasterizer);
      drawnSizes.set(out, { width, height });
    }
    const scale = host ? [host.texture.width / width, host.texture.height / height] : [1, 1];
    writeStruct(layouts.SceneDepth, { ...readingOf(host, camera), scale }, this.#bytes);
    this.#device.queue.writeBuffer(this.#uniform, 0, this.#bytes);
  }

  /**
   * Size of the last frame in pixels; zeros before the first. The settings or the limits of the device may make it
   * smaller than the target.
   */
  get drawn(): Size {
    return (this.#outTexture && drawnSizes.get(this.#outTexture)) ?? { width: 0, height: 0 };
  }

  /** Texture that receives the median depth; undefined without this output. */
  get out(): GPUTexture | undefined {
    return this.#outTexture;
  }

  get overrides(): Overrides {
    const { layers } = this;
    return { tests_depth: +(this.#host !== undefined), writes_depth: +(this.#outTexture !== undefined), layers };
  }

  get layers(): number {
    const { color, second } = this.#host ?? {};
    return color ? 1 + +(second !== undefined) : 0;
  }

  get resources(): PaintingDepth['resources'] {
    return { scene: this.#uniform, stored_depth: this.#stored, median_depth: this.#out, ...this.#layerViews };
  }

  get layerProgram(): ShaderProgram<typeof blendLayers> {
    const both = SHADER_STAGE.vertex | SHADER_STAGE.fragment;
    return perDevice(this.#device, 'blend layers', () => new ShaderProgram(this.#device, blendLayers, both));
  }

  get layerBindings(): GPUBindGroup {
    const own = { scene: this.#uniform, stored_depth: this.#stored, ...this.#layerViews };
    return (this.#layerBindings ??= this.layerProgram.bind(own));
  }

  painter(depths: GPUBuffer): TilePainter {
    return {
      tile: constants.TILE,
      kernel: (variant) => rasterizeKernel(this.#device, rasterizeTilesDepth, variant, this.overrides),
      few: (variant, stage) =>
        rasterizeKernel(this.#device, rasterizeTilesDepthFew, variant, { ...this.overrides, stage }),
      // A segment does not know which layers are blended in front of it.
      hasWholeLists: this.layers > 0,
      bind: (kernel, painted) => this.#tiles.bind(kernel, painted, { depths, ...this.resources }),
    };
  }

  get quadsProgram(): QuadsWithDepth {
    const both = SHADER_STAGE.vertex | SHADER_STAGE.fragment;
    return perDevice(this.#device, 'quads depth', () => {
      const program = new ShaderProgram(this.#device, rasterizeQuadsDepth, both);
      return {
        ...{ module: program.module, pipelineLayout: program.pipelineLayout, name: ' depth' },
        bind: (resources, depth, depths) => (depth as SceneDepth).#bindQuads(program, resources, depths),
      };
    });
  }

  /** Destroys the uniform buffer. The textures belong to the host. */
  destroy(): void {
    this.#uniform.destroy();
  }

  #bindQuads(
    program: ShaderProgram<typeof rasterizeQuadsDepth>,
    resources: Parameters<QuadsWithDepth['bind']>[0],
    depths: GPUBuffer,
  ): GPUBindGroup {
    const key = [depths, ...Object.values(resources)];
    if (!isSame(this.#quads?.key, key)) {
      const own = { scene: this.#uniform, depths, stored_depth: this.#stored, ...this.#layerViews };
      this.#quads = { key, group: program.bind({ ...resources, ...own }) };
    }
    return this.#quads!.group;
  }
}

const isSame = (a: readonly unknown[] | undefined, b: readonly unknown[]): boolean =>
  a?.length === b.length && a.every((value, k) => value === b[k]);

/** Returns the conversion of the host's values to camera depths: see `deviceReading`. */
function readingOf(host: HostDepth | undefined, camera: Camera): { inverse: number[]; nothing: number } {
  if (host === undefined || valuesOf(host) === 'linear') return { inverse: [1, 0, 0, 1], nothing: 0 };
  return deviceReading(host, camera);
}

const valuesOf = ({ values, texture }: HostDepth): 'device' | 'linear' =>
  values ?? (texture.format === 'r32float' ? 'linear' : 'device');

const viewOf = (texture: GPUTexture): GPUTextureView =>
  texture.createView({
    ...{ dimension: '2d', mipLevelCount: 1, arrayLayerCount: 1 },
    ...(texture.format === 'r32float' ? {} : { aspect: 'depth-only' }),
  });

const nothing = (device: GPUDevice): GPUTextureView =>
  perDevice(device, 'no depth', () => small(device, TEXTURE_USAGE.textureBinding).createView());

const nowhere = (device: GPUDevice): GPUTexture =>
  perDevice(device, 'no depth out', () => small(device, TEXTURE_USAGE.storageBinding));

const small = (device: GPUDevice, usage: number): GPUTexture =>
  device.createTexture({ label: 'gs.no_depth', size: [1, 1], format: 'r32float', usage });

function requireHost({ texture, near, far, color, second }: HostDepth): void {
  for (const own of [color, second?.texture, second?.color]) {
    if (own && (own.width !== texture.width || own.height !== texture.height))
      throw wrong('HostDepth.color', 'textures of one size', `${own.width} x ${own.height}`);
  }
  if (second && (!color || second.texture.format !== texture.format))
    throw wrong('HostDepth.second', 'a first layer with color, and depths of one format', second.texture.format);
  const { format, sampleCount, usage } = texture ?? {};
  if (!FORMATS.test(format))
    throw wrong('HostDepth.texture', 'depth32float, depth24plus, depth16unorm or r32float', String(format));
  if (sampleCount !== 1)
    throw wrong('HostDepth.texture', 'a texture of sampleCount 1: resolve the depth first', sampleCount);
  if ((usage & TEXTURE_USAGE.textureBinding) === 0)
    throw wrong('HostDepth.texture', 'a texture with the usage TEXTURE_BINDING', `usage ${usage}`);
  for (const [name, plane] of Object.entries({ near, far })) {
    if (plane !== undefined && !(plane > 0)) throw wrong(`HostDepth.${name}`, 'a distance above 0', plane);
  }
}

function requireOut({ format, usage }: GPUTexture): void {
  if (format !== 'r32float') throw wrong('SceneDepth.out', 'a texture of the format r32float', format);
  if ((usage & TEXTURE_USAGE.storageBinding) === 0)
    throw wrong('SceneDepth.out', 'a texture with the usage STORAGE_BINDING', `usage ${usage}`);
}

/**
 * Checks that the output texture can hold the depth of a frame.
 * @param width Width of the drawn image in pixels.
 * @param height Height of the drawn image in pixels.
 */
function requireRoom(out: GPUTexture, width: number, height: number, rasterizer: RasterizerName): void {
  if (rasterizer !== 'tiles')
    throw new GaussianSplatError('unsupported/limits', {
      where: 'SceneDepth.out',
      expected: 'settings with the rasterizer tiles',
      found: rasterizer,
      remedy: "draw with settings('default', { rasterizer: 'tiles' })",
    });
  if (out.width >= width && out.height >= height) return;
  const expected = `a texture of at least ${width} x ${height} pixels, as many as are drawn`;
  throw wrong('SceneDepth.out', expected, `${out.width} x ${out.height}`);
}

function wrong(where: string, expected: string, found: unknown): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    ...{ where, expected, found: String(found) },
    remedy: `see ${where}`,
  });
}
