/** Description of a shader, which scripts/build-shaders.mjs generates. */
export interface ShaderDescription {
  readonly name: string;
  readonly code: string;
  readonly bindings: Readonly<Record<string, ShaderBinding>>;
}

interface ShaderBinding {
  readonly binding: number;
  readonly type: 'uniform' | 'storage' | 'read-only-storage' | 'texture' | 'storage-texture';
  /** Format of a storage texture; undefined for other types. */
  readonly format?: GPUTextureFormat;
}

/** Resources of a shader, keyed by the names of its bindings in WGSL. */
export type Resources<S extends ShaderDescription> = Readonly<Record<keyof S['bindings'], Resource>>;

/** A whole buffer, a range of a buffer, or a texture view. */
export type Resource = GPUBuffer | GPUBufferBinding | GPUTextureView;

/** The bind group layout and shader module of a shader on one device. */
export class ShaderProgram<S extends ShaderDescription> {
  readonly module: GPUShaderModule;
  readonly pipelineLayout: GPUPipelineLayout;
  readonly #device: GPUDevice;
  readonly #shader: S;
  readonly #bindGroupLayout: GPUBindGroupLayout;

  constructor(device: GPUDevice, shader: S, visibility: GPUShaderStageFlags) {
    const label = `gs.${shader.name}`;
    this.#device = device;
    this.#shader = shader;
    this.module = device.createShaderModule({ label, code: shader.code });
    this.#bindGroupLayout = device.createBindGroupLayout({
      label,
      entries: Object.values(shader.bindings).map((binding) => layoutEntry(binding, visibility)),
    });
    this.pipelineLayout = device.createPipelineLayout({ label, bindGroupLayouts: [this.#bindGroupLayout] });
  }

  bind(resources: Resources<S>): GPUBindGroup {
    return this.#device.createBindGroup({
      label: `gs.${this.#shader.name}`,
      layout: this.#bindGroupLayout,
      entries: Object.entries(this.#shader.bindings).map(([name, { binding }]) => ({
        binding,
        resource: asBindingResource(resources[name as keyof S['bindings']]),
      })),
    });
  }
}

function layoutEntry(
  { binding, type, format }: ShaderBinding,
  visibility: GPUShaderStageFlags,
): GPUBindGroupLayoutEntry {
  switch (type) {
    case 'texture':
      return { binding, visibility, texture: { sampleType: 'unfilterable-float' } };
    case 'storage-texture':
      return { binding, visibility, storageTexture: { format: format! } };
    default:
      return { binding, visibility, buffer: { type } };
  }
}

/** Wraps a buffer in a binding: bare buffers as bindings are a recent addition to WebGPU, which older browsers lack. */
function asBindingResource(resource: Resource): GPUBindingResource {
  return 'mapState' in resource ? { buffer: resource } : resource;
}

/** Values of the `override` constants of a shader, by their names. */
export type Overrides = Readonly<Record<string, number>>;

/** A compute shader on one device. Its entry point is `main`. */
export class ComputeKernel<S extends ShaderDescription> extends ShaderProgram<S> {
  readonly #device: GPUDevice;
  readonly #name: string;
  readonly #overrides: Overrides;
  #made: GPUComputePipeline | undefined;
  #making: Promise<void> | undefined;

  constructor(device: GPUDevice, shader: S, overrides: Overrides = {}) {
    super(device, shader, SHADER_STAGE.compute);
    this.#device = device;
    this.#name = shader.name;
    this.#overrides = overrides;
  }

  /**
   * Compiles the pipeline, the most expensive part of a kernel, so that no frame compiles it. Within {@link
   * madeTogether} all pipelines are compiled concurrently.
   */
  prepare(): this {
    const { together } = makingOn(this.#device);
    if (together && !this.#made) together.push((this.#making ??= this.#makeBeside()));
    else this.#made ??= this.#device.createComputePipeline(this.#descriptor);
    return this;
  }

  async #makeBeside(): Promise<void> {
    // A failed compilation fails again at the first use of the pipeline, which reports the error.
    const made = await this.#device.createComputePipelineAsync(this.#descriptor).catch(() => undefined);
    this.#made ??= made;
  }

  get #descriptor(): GPUComputePipelineDescriptor {
    return {
      label: `gs.${this.#name}`,
      layout: this.pipelineLayout,
      compute: { module: this.module, entryPoint: 'main', constants: this.#overrides },
    };
  }

  get #pipeline(): GPUComputePipeline {
    // Compiles synchronously if the pipeline is missing, because a frame cannot wait.
    return (this.#made ??= this.#device.createComputePipeline(this.#descriptor));
  }

  /** Dispatches a grid of workgroups: `columns` by `rows`, each at most 65,535. */
  dispatchGrid(pass: GPUComputePassEncoder, bindGroup: GPUBindGroup, columns: number, rows: number): void {
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, bindGroup);
    pass.dispatchWorkgroups(columns, rows);
  }

  /**
   * Dispatches a number of workgroups. More than 65,535 are dispatched in two dimensions; the shader gets its index
   * from `group_index`.
   */
  dispatch(pass: GPUComputePassEncoder, bindGroup: GPUBindGroup, groups: number): void {
    if (groups === 0) return;
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, bindGroup);
    pass.dispatchWorkgroups(...dispatchGrid(groups));
  }
}

/**
 * Compilations on a device that {@link madeTogether} waits for; `together` is undefined outside its call of `prepare`.
 */
const makingOn = (device: GPUDevice): { together?: Promise<void>[] } => perDevice(device, 'making', () => ({}));

/**
 * Compiles the compute pipelines that `prepare` requests concurrently, and waits for all of them. Sequential
 * compilation takes about a second with a GPU driver, and the browser updates no page during that time.
 */
export async function madeTogether(device: GPUDevice, prepare: () => void): Promise<void> {
  const making = makingOn(device);
  const together: Promise<void>[] = [];
  making.together = together;
  try {
    prepare();
  } finally {
    making.together = undefined;
  }
  await Promise.all(together);
}

/** WebGPU's default limit of workgroups in one dimension (`MAX_GROUPS_X` in the shaders). */
const MAX_GROUPS = 65535;

/**
 * Returns the columns and rows of a grid for a number of workgroups: the inverse of `group_index` of
 * shaders/shared/group.wgsl.
 */
export function dispatchGrid(groups: number): [columns: number, rows: number] {
  return [Math.min(groups, MAX_GROUPS), Math.ceil(groups / MAX_GROUPS)];
}

/** Bits of `GPUShaderStage`, a global that is undefined if a module is imported outside a browser. */
export const SHADER_STAGE = { vertex: 1, fragment: 2, compute: 4 } as const;

/** Bits of `GPUBufferUsage`. */
export const BUFFER_USAGE = {
  mapRead: 0x1,
  mapWrite: 0x2,
  copySource: 0x4,
  copyDestination: 0x8,
  index: 0x10,
  uniform: 0x40,
  storage: 0x80,
} as const;
export const TEXTURE_USAGE = {
  copySource: 0x1,
  copyDestination: 0x2,
  textureBinding: 0x4,
  storageBinding: 0x8,
  renderAttachment: 0x10,
} as const;

const cache = new WeakMap<object, Map<string, unknown>>();

/**
 * Returns the object of a device with this key, for example a pipeline. The first call creates it with `make`; all
 * renderers of the device share the object.
 */
export function perDevice<T>(device: object, key: string, make: () => T): T {
  let made = cache.get(device);
  if (made === undefined) cache.set(device, (made = new Map()));
  if (!made.has(key)) made.set(key, make());
  return made.get(key) as T;
}

/**
 * Returns the kernel of a compute shader with the given overrides. The kernel is created and compiled once for each
 * device.
 */
export function kernelOf<S extends ShaderDescription>(
  device: GPUDevice,
  shader: S,
  overrides: Overrides = {},
): ComputeKernel<S> {
  return rareKernelOf(device, shader, overrides).prepare();
}

/**
 * Returns the kernel of a rarely used compute shader, which {@link kernelOf} would compile at once. Call {@link
 * ComputeKernel.prepare} when a scene needs the kernel.
 */
export function rareKernelOf<S extends ShaderDescription>(
  device: GPUDevice,
  shader: S,
  overrides: Overrides = {},
): ComputeKernel<S> {
  const key = `${shader.name} ${JSON.stringify(overrides)}`;
  return perDevice(device, key, () => new ComputeKernel(device, shader, overrides));
}

/** Returns a shader whose storage texture `image` has another format, because WGSL cannot parameterize the format. */
export function storingInto<S extends ShaderDescription & { bindings: { image: ShaderBinding } }>(
  shader: S,
  format: GPUTextureFormat,
): S {
  const { image } = shader.bindings;
  return {
    ...shader,
    name: `${shader.name}.${format}`,
    code: shader.code.replace(`texture_storage_2d<${image.format}`, `texture_storage_2d<${format}`),
    bindings: { ...shader.bindings, image: { ...image, format } },
  };
}
