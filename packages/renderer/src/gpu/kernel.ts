/** Description of one shader, from scripts/build-shaders.mjs. */
export interface ShaderDescription {
  readonly name: string;
  readonly code: string;
  readonly bindings: Readonly<Record<string, ShaderBinding>>;
}

interface ShaderBinding {
  readonly binding: number;
  readonly type: 'uniform' | 'storage' | 'read-only-storage' | 'texture' | 'storage-texture';
  /** Only for a storage texture. */
  readonly format?: GPUTextureFormat;
}

/** A resource for each binding of a shader, by its name in the WGSL. */
export type Resources<S extends ShaderDescription> = Readonly<Record<keyof S['bindings'], Resource>>;

/** A whole buffer, a range of one, or a texture view. */
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

/** Bare buffers are a recent addition to WebGPU, so they are wrapped for older browsers. */
function asBindingResource(resource: Resource): GPUBindingResource {
  return 'mapState' in resource ? { buffer: resource } : resource;
}

/** Values of the `override` constants of a shader, by their names. */
export type Overrides = Readonly<Record<string, number>>;

/** A compute shader that can be dispatched. Its entry point is `main`. */
export class ComputeKernel<S extends ShaderDescription> {
  readonly #device: GPUDevice;
  readonly #name: string;
  readonly #overrides: Overrides;
  readonly #program: ShaderProgram<S>;
  #made: GPUComputePipeline | undefined;
  #making: Promise<void> | undefined;

  constructor(device: GPUDevice, shader: S, overrides: Overrides = {}) {
    this.#device = device;
    this.#name = shader.name;
    this.#overrides = overrides;
    this.#program = new ShaderProgram(device, shader, SHADER_STAGE.compute);
  }

  /**
   * Compiles the pipeline, by far the most expensive part, so that no frame has to; concurrently with others within
   * {@link madeTogether}.
   */
  prepare(): this {
    const { together } = makingOn(this.#device);
    if (together && !this.#made) together.push((this.#making ??= this.#makeBeside()));
    else this.#made ??= this.#device.createComputePipeline(this.#descriptor);
    return this;
  }

  async #makeBeside(): Promise<void> {
    // A failure occurs again at the first use, and is reported there.
    const made = await this.#device.createComputePipelineAsync(this.#descriptor).catch(() => undefined);
    this.#made ??= made;
  }

  get #descriptor(): GPUComputePipelineDescriptor {
    return {
      label: `gs.${this.#name}`,
      layout: this.#program.pipelineLayout,
      compute: { module: this.#program.module, entryPoint: 'main', constants: this.#overrides },
    };
  }

  bind(resources: Resources<S>): GPUBindGroup {
    return this.#program.bind(resources);
  }

  get #pipeline(): GPUComputePipeline {
    // A frame cannot wait, so it compiles synchronously.
    return (this.#made ??= this.#device.createComputePipeline(this.#descriptor));
  }

  /** Dispatches a grid of workgroups, each side at most 65,535. */
  dispatchGrid(pass: GPUComputePassEncoder, bindGroup: GPUBindGroup, columns: number, rows: number): void {
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, bindGroup);
    pass.dispatchWorkgroups(columns, rows);
  }

  /** Dispatches a number of workgroups, in two dimensions beyond 65,535: the shader finds its number by `group_index`. */
  dispatch(pass: GPUComputePassEncoder, bindGroup: GPUBindGroup, groups: number): void {
    if (groups === 0) return;
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, bindGroup);
    pass.dispatchWorkgroups(...dispatchGrid(groups));
  }
}

/** Pipelines that are compiled concurrently. */
const makingOn = (device: GPUDevice): { together?: Promise<void>[] } => perDevice(device, 'making', () => ({}));

/**
 * Waits for the compute pipelines that `prepare` requests, which the browser compiles concurrently. In sequence they
 * take a GPU driver a second, during which the browser updates no page.
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

/** Workgroups across and down for a total number: the inverse of `group_index` of shaders/shared/group.wgsl. */
export function dispatchGrid(groups: number): [columns: number, rows: number] {
  return [Math.min(groups, MAX_GROUPS), Math.ceil(groups / MAX_GROUPS)];
}

/** `GPUShaderStage`, which is undefined if a module is imported outside a browser. */
export const SHADER_STAGE = { vertex: 1, fragment: 2, compute: 4 } as const;

/** Bits of `GPUBufferUsage` and `GPUTextureUsage`. */
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

/** An object that is created once for a device (a pipeline, for example) and shared by all its renderers. */
export function perDevice<T>(device: object, key: string, make: () => T): T {
  let made = cache.get(device);
  if (made === undefined) cache.set(device, (made = new Map()));
  if (!made.has(key)) made.set(key, make());
  return made.get(key) as T;
}

/** Returns the kernel of a compute shader with the given overrides, created once for a device and compiled at once. */
export function kernelOf<S extends ShaderDescription>(
  device: GPUDevice,
  shader: S,
  overrides: Overrides = {},
): ComputeKernel<S> {
  return rareKernelOf(device, shader, overrides).prepare();
}

/** The same for rarely used shaders: call {@link ComputeKernel.prepare} when a scene needs one. */
export function rareKernelOf<S extends ShaderDescription>(
  device: GPUDevice,
  shader: S,
  overrides: Overrides = {},
): ComputeKernel<S> {
  const key = `${shader.name} ${JSON.stringify(overrides)}`;
  return perDevice(device, key, () => new ComputeKernel(device, shader, overrides));
}

/** Replaces the format of the storage texture `image` of a shader, because WGSL cannot parameterize it. */
export function storingInto<S extends ShaderDescription & { bindings: { image: ShaderBinding } }>(
  shader: S,
  format: GPUTextureFormat,
): S {
  const { image } = shader.bindings;
  const declared = `texture_storage_2d<${image.format}`;
  if (!shader.code.includes(declared)) throw new Error(`shader ${shader.name} has no "${declared}"`);
  return {
    ...shader,
    name: `${shader.name}.${format}`,
    code: shader.code.replace(declared, `texture_storage_2d<${format}`),
    bindings: { ...shader.bindings, image: { ...image, format } },
  };
}
