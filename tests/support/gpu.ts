/** GPU helpers of the stage tests, the same in Node and in a browser page. */
import { GpuMemory } from '@gaussian-splat/renderer/stages';

/** A device under test: buffers made through it are freed with it, and validation errors fail the test. */
export interface Bench {
  readonly device: GPUDevice;
  readonly memory: GpuMemory;
  /** A storage buffer that can also be read back; `content` is a size in bytes or the words to put there. */
  buffer(content: number | Uint32Array): GPUBuffer;
  uniform(...words: number[]): GPUBuffer;
  read(buffer: GPUBuffer, byteLength?: number): Promise<Uint32Array>;
  /** Records one compute pass and submits it. */
  compute(record: (pass: GPUComputePassEncoder) => void): void;
}

/** One test of a stage. */
export interface StageCase {
  readonly name: string;
  run(bench: Bench): Promise<void>;
}

const STORAGE = 0x80 | 0x100 | 0x4 | 0x8;

/** Runs a case on a device: any validation error fails it, and all its memory is freed. */
export async function runCase(device: GPUDevice, stageCase: StageCase): Promise<void> {
  const memory = new GpuMemory(device);
  device.pushErrorScope('validation');
  try {
    await stageCase.run(makeBench(device, memory));
  } finally {
    const error = await device.popErrorScope();
    memory.destroy();
    check(error === null, `WebGPU validation: ${error?.message}`);
  }
}

function makeBench(device: GPUDevice, memory: GpuMemory): Bench {
  return {
    device,
    memory,
    buffer(content) {
      if (typeof content === 'number') return memory.buffer('test', content, STORAGE);
      return memory.buffer('test', content.byteLength, STORAGE, content);
    },
    uniform: (...words) => memory.buffer('test uniform', 4 * words.length, 0x40 | 0x8, Uint32Array.from(words)),
    async read(buffer, byteLength = buffer.size) {
      const staging = device.createBuffer({ size: byteLength, usage: 0x1 | 0x8 });
      const encoder = device.createCommandEncoder();
      encoder.copyBufferToBuffer(buffer, 0, staging, 0, byteLength);
      device.queue.submit([encoder.finish()]);
      await staging.mapAsync(0x1);
      const words = new Uint32Array(staging.getMappedRange().slice(0));
      staging.destroy();
      return words;
    },
    compute(record) {
      const encoder = device.createCommandEncoder();
      const pass = encoder.beginComputePass();
      record(pass);
      pass.end();
      device.queue.submit([encoder.finish()]);
    },
  };
}

/** The same device, which says that it binds at most the given number of bytes of a buffer. */
export function withBufferLimit(device: GPUDevice, limit: number): GPUDevice {
  return new Proxy(device, {
    get(target, name) {
      if (name === 'limits') return { maxBufferSize: limit, maxStorageBufferBindingSize: limit };
      const value = Reflect.get(target, name, target) as unknown;
      return typeof value === 'function' ? value.bind(target) : value;
    },
  });
}

/** Fails the running test with a message unless the condition holds. */
export function check(condition: boolean, message: string): asserts condition {
  if (!condition) throw new Error(message);
}

/** Fails at the first index at which two arrays differ. */
export function checkEqual(actual: ArrayLike<number>, expected: ArrayLike<number>, what: string): void {
  check(actual.length >= expected.length, `${what}: ${actual.length} values, expected ${expected.length}`);
  for (let i = 0; i < expected.length; i++) {
    if (actual[i] !== expected[i]) throw new Error(`${what}[${i}]: ${actual[i]}, expected ${expected[i]}`);
  }
}

/** A small seeded generator of uniform numbers in 0..1 (mulberry32). */
export function randomSource(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(state ^ (state >>> 15), state | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}
