/** The rules of placement against the runtime of pages: for each rule's file, where it runs and what it computes. */
import { bytesSource, gpuFindings, readOnnxHeader } from '@gaussian-splat/core/onnx';
import type * as LoadRuntime from '../../../packages/generator/dist/runtime/load-runtime.js';
import { assertEqual } from '../../element/browser/support/harness.js';
import { someOf } from '../../support/extent-in-pages.js';
import { makeDevice, relativeError } from './support.js';

const BUILT = '/packages/generator/dist/runtime/load-runtime.js';
/** Kinds of findings of files that run, but not entirely or not exactly on the GPU. */
const RUNS: readonly string[] = ['fallback', 'wrong', 'slow', 'inexact'];

let runtime: LoadRuntime.Runtime;
let device: GPUDevice;
let expected: Readonly<Record<string, readonly (readonly [kind: string, operator: string])[]>>;

before(async () => {
  device = await makeDevice();
  runtime = await ((await import(BUILT)) as typeof LoadRuntime).loadRuntime();
  expected = (await (await fetch('/tests/fixtures/gpu-findings.json')).json()) as typeof expected;
});

/** Runs a file of one input and one output. @returns Its numbers, or the message of the runtime. */
async function run(bytes: Uint8Array, options: object): Promise<number[] | string> {
  const { InferenceSession, Tensor } = runtime.ort;
  try {
    const session = await InferenceSession.create(bytes, { logSeverityLevel: 4, ...options });
    const [{ dims }] = (await readOnnxHeader(bytesSource(bytes, 'rule'))).inputs;
    const shape = dims!.map((dim) => (typeof dim === 'number' ? dim : 4));
    const size = shape.reduce((product, dim) => product * dim, 1);
    const data = Float32Array.from({ length: size }, (_, i) => Math.sin(i + 1));
    const [output] = Object.values(await session.run({ x: new Tensor('float32', data, shape) }));
    const numbers = Array.from((await output.getData()) as Float32Array);
    await session.release();
    return numbers;
  } catch (error) {
    return String(error);
  }
}

it('every file of a rule runs where the rules say, with the numbers of the CPU unless they say "wrong"', async () => {
  const names = Object.keys(expected).filter((name) => name.startsWith('rules/'));
  for (const name of someOf(names, 8)) {
    const bytes = new Uint8Array(await (await fetch(`/tests/fixtures/${name}`)).arrayBuffer());
    const header = await readOnnxHeader(bytesSource(bytes, name));
    const kinds = gpuFindings(header).map(({ kind }) => kind);
    const isFloat = header.inputs.length === 1 && header.inputs[0].dtype === 'float32';
    if (!isFloat || !kinds.every((kind) => RUNS.includes(kind))) continue;
    const gpu = { executionProviders: [{ name: 'webgpu', device }] };
    const alone = await run(bytes, { ...gpu, extra: { session: { disable_cpu_ep_fallback: '1' } } });
    // A symbolic size and control flow leave no kernel to the CPU; they only end recordings.
    const isPlaced = !kinds.includes('fallback') || /symbolic|if\.onnx/.test(name);
    assertEqual(typeof alone === 'string' ? 'on the CPU' : 'on the GPU', isPlaced ? 'on the GPU' : 'on the CPU', name);
    if (typeof alone === 'string') continue;
    const onCpu = await run(bytes, { executionProviders: ['wasm'], graphOptimizationLevel: 'basic' });
    if (typeof onCpu === 'string') throw new Error(`${name}: ${onCpu}`);
    assertEqual(relativeError(alone, onCpu) > 1e-3, kinds.includes('wrong'), `${name}: wrong`);
  }
});
