/** Counts a renderer's calls of a device: work that is the same on every machine, unlike time. */

/** Work since the last {@link WorkCounter.take}. */
export interface Work {
  submits: number;
  computePasses: number;
  renderPasses: number;
  /** Dispatches whose size the CPU knows. */
  dispatches: number;
  /** Dispatches and draws whose size the GPU finds. */
  indirectCalls: number;
  /** Workgroups of the dispatches whose size the CPU knows. */
  workgroups: number;
  draws: number;
  buffersCreated: number;
  /** Bytes of the buffers and textures that were created. */
  bytesAllocated: number;
  /** Bytes that the CPU wrote into buffers. */
  bytesWritten: number;
}

export interface WorkCounter {
  /** The counts since the last call; counting starts again. */
  take(): Work;
}

type Method = (...args: never[]) => unknown;

/** Bytes of one pixel in the formats that the renderer uses. */
const BYTES_PER_PIXEL: Readonly<Record<string, number>> = {
  rgba8unorm: 4,
  'rgba8unorm-srgb': 4,
  rgba8uint: 4,
  depth32float: 4,
  depth24plus: 4,
  r32float: 4,
  rgba16float: 8,
  rgba32float: 16,
};

const noWork = (): Work => ({
  submits: 0,
  computePasses: 0,
  renderPasses: 0,
  dispatches: 0,
  indirectCalls: 0,
  workgroups: 0,
  draws: 0,
  buffersCreated: 0,
  bytesAllocated: 0,
  bytesWritten: 0,
});

/** Counts every call on a device, its queue, and the encoders and passes made from it, from now on. */
export function countWork(device: GPUDevice): WorkCounter {
  let work = noWork();
  after(device, 'createBuffer', (_, { size }: GPUBufferDescriptor) => {
    work.buffersCreated++;
    work.bytesAllocated += size;
  });
  after(device, 'createTexture', (texture: GPUTexture) => {
    const bytes = BYTES_PER_PIXEL[texture.format];
    if (bytes === undefined) throw new RangeError(`countWork: bytes of a pixel of ${texture.format} are not known`);
    work.bytesAllocated += bytes * texture.width * texture.height;
  });
  after(device.queue, 'submit', () => work.submits++);
  after(device.queue, 'writeBuffer', (_, __: GPUBuffer, ___: number, data: ArrayBuffer | ArrayBufferView) => {
    work.bytesWritten += data.byteLength;
  });
  after(device, 'createCommandEncoder', (encoder: GPUCommandEncoder) => {
    after(encoder, 'beginComputePass', (pass: GPUComputePassEncoder) => {
      work.computePasses++;
      after(pass, 'dispatchWorkgroups', (_, x: number, y: number | undefined, z: number | undefined) => {
        work.dispatches++;
        work.workgroups += x * (y ?? 1) * (z ?? 1);
      });
      after(pass, 'dispatchWorkgroupsIndirect', () => work.indirectCalls++);
    });
    after(encoder, 'beginRenderPass', (pass: GPURenderPassEncoder) => {
      work.renderPasses++;
      for (const name of ['draw', 'drawIndexed'] as const) after(pass, name, () => work.draws++);
      for (const name of ['drawIndirect', 'drawIndexedIndirect'] as const)
        after(pass, name, () => work.indirectCalls++);
    });
  });
  return {
    take() {
      const taken = work;
      work = noWork();
      return taken;
    },
  };
}

/** Calls `note` with the result and the arguments of every call of a method. */
function after<T extends object, Result, Args extends unknown[]>(
  target: T,
  name: keyof T & string,
  note: (result: Result, ...args: Args) => void,
): void {
  const original = target[name] as unknown as Method;
  Object.defineProperty(target, name, {
    configurable: true,
    // Others wrap it, too.
    writable: true,
    value: (...args: never[]) => {
      const result = original.apply(target, args);
      note(result as Result, ...(args as unknown as Args));
      return result;
    },
  });
}
