/** Generators on the GPU of a real browser: true numbers, nothing needless on the frame path, faults that leave the page alive. */
import { DynamicGaussians } from '@gaussian-splat/renderer';
import { Generator, isRuntimeRequested, type GeneratorOptions, type ModelSource } from '@gaussian-splat/generator';
import { assert, assertEqual, delay } from '../../element/browser/support/harness.js';
import { itInLab, someOf } from '../../support/extent-in-pages.js';
import {
  calls,
  CAMERA,
  codeOf,
  FIXTURES,
  makeDevice,
  numbersOf,
  ReadingSink,
  relativeError,
  runOnCpu,
} from './support.js';
import { capture, Renderer } from '../../support/renderer.js';

let device: GPUDevice;
const opened: Generator[] = [];

async function open(
  name: string,
  options: GeneratorOptions = {},
  source: Partial<ModelSource> = {},
): Promise<Generator> {
  const onError = (error: unknown): void => reportError(error);
  const generator = await Generator.open({ url: FIXTURES + name, ...source }, device, { onError, ...options });
  opened.push(generator);
  return generator;
}

/** Address of the ball as a model of another opset. */
async function withOpset(version: number): Promise<string> {
  const bytes = new Uint8Array(await (await fetch(`${FIXTURES}packed.onnx`)).arrayBuffer());
  // The only opset of the file: field 8 of the model, with an empty domain and version 17.
  const entry = [0x42, 0x04, 0x0a, 0x00, 0x10, 17];
  const at = bytes.findIndex((_, i) => entry.every((byte, k) => bytes[i + k] === byte));
  assert(at > 0, 'the opset of the fixture');
  bytes[at + 5] = version;
  return URL.createObjectURL(new Blob([bytes]));
}

describe('generators', () => {
  before(async () => {
    device = await makeDevice();
  });
  afterEach(() => {
    for (const generator of opened.splice(0)) generator.close();
  });

  it('are checked before a byte of the runtime is fetched', async () => {
    const cases: Readonly<Record<string, readonly [url: string, code: string, contract?: unknown]>> = {
      'a missing file': ['/net/status/404', 'network/status'],
      'a web page': ['/net/html/model.onnx', 'decode/html'],
      'a truncated file': ['/net/head/packed.onnx', 'decode/truncated'],
      'a scene': ['/tests/element/browser/fixtures/compass.ply', 'decode/unknown-format'],
      'a wrong role': [`${FIXTURES}packed.onnx`, 'contract/schema', { version: 1, inputs: { time: { role: 'tiem' } } }],
      'an input without a role': [
        `${FIXTURES}packed.onnx`,
        'contract/unbound-input',
        {
          version: 1,
          inputs: {},
          outputs: { layout: 'packed', gaussians: 'gaussians', color: 'rgb', opacityActivation: 'linear' },
        },
      ],
      'a wrong shape': [
        `${FIXTURES}packed.onnx`,
        'contract/shape',
        {
          version: 1,
          inputs: { time: { role: 'viewport' } },
          outputs: { layout: 'packed', gaussians: 'gaussians', color: 'rgb', opacityActivation: 'linear' },
        },
      ],
      'a wrong element type': [
        `${FIXTURES}packed.onnx`,
        'contract/dtype',
        {
          version: 1,
          inputs: { time: { role: 'time', unit: 'seconds' } },
          outputs: { layout: 'packed', gaussians: 'gaussians', color: 'rgb', opacityActivation: 'linear' },
          dtype: 'float16',
        },
      ],
      'a missing output': [
        `${FIXTURES}packed.onnx`,
        'contract/missing-tensor',
        {
          version: 1,
          inputs: { time: { role: 'time', unit: 'seconds' } },
          outputs: { layout: 'packed', gaussians: 'splats', color: 'rgb', opacityActivation: 'linear' },
        },
      ],
      'no contract and names that say nothing': [`${FIXTURES}subgraphs.onnx`, 'contract/inference'],
      'external data that is missing': ['/net/renamed/external.onnx', 'contract/external-data'],
      'an opset that is too new': [await withOpset(27), 'contract/opset'],
      'a post-processor': [`${FIXTURES}post.onnx`, 'contract/chain'],
      'a link of a chain': [`${FIXTURES}link.onnx`, 'contract/chain'],
      'a contract that is no JSON': [`${FIXTURES}packed.onnx`, 'contract/json', '{"version": 1'],
    };
    const found: Record<string, string> = {};
    for (const [name, [url, , contract]] of Object.entries(cases)) {
      found[name] = await codeOf(Generator.open({ url, contract }, device));
    }
    assertEqual(found, Object.fromEntries(Object.entries(cases).map(([name, [, code]]) => [name, code])), 'codes');
    assert(!isRuntimeRequested(), 'the runtime was asked for');
  });

  const named = [
    ['packed.onnx', 'captured', 1e-3],
    ['canonical.onnx', 'captured', 1e-3],
    ['split.onnx', 'captured', 1e-3],
    ['external.onnx', 'captured', 1e-3],
    // Float16 without the device feature runs on the CPU.
    ['packed-sh-half.onnx', 'wasm', 5e-3],
    ['visionary-sh.onnx', 'wasm', 5e-3],
  ] as const;
  for (const [name, kind, limit] of someOf<(typeof named)[number]>(named, 3)) {
    it(`${name} writes on the GPU what ONNX Runtime writes on the CPU`, async () => {
      const reasons: string[] = [];
      const generator = await open(name, { onFallback: (reason) => reasons.push(reason) });
      const sink = new ReadingSink(device);
      generator.sink = sink;
      const states = [0, 0.7, 2].map((timeSeconds) => ({
        timeSeconds,
        camera: CAMERA,
        pose: name === 'split.onnx' ? Array.from({ length: 6 }, (_, i) => 0.1 * i * timeSeconds) : undefined,
        controls: name === 'packed-sh-half.onnx' ? { share: timeSeconds / 2 } : undefined,
      }));
      for (const state of states) {
        generator.request(state);
        await generator.idle;
      }
      if (device.features.has('shader-f16') === false) assertEqual(generator.kind, kind, 'kind');
      assertEqual(reasons.length, generator.kind === 'wasm' ? 1 : 0, `fallbacks: ${reasons.join()}`);
      // The state of the first frame may repeat if nothing depends on the time.
      const { layout } = generator.model;
      const expected = await runOnCpu(FIXTURES + name, states[sink.runs.length - 1]);
      const last = sink.runs[sink.runs.length - 1];
      for (const tensor of new Set(layout.attributes.map((slice) => slice.tensor))) {
        const { dims, values } = expected[tensor];
        assertEqual(last.rows, dims[0], 'rows');
        const found = numbersOf(await last.tensors[tensor], layout.dtype);
        const error = relativeError(found, values);
        assert(error <= limit, `${tensor}: relative error ${error}`);
      }
      if (layout.count) {
        const found = numbersOf(await last.tensors[layout.count], 'int32')[0];
        assertEqual(found, expected[layout.count].values[0], 'count of rows');
      }
    });
  }

  itInLab('are not recorded where a recording would lose what the runtime copies', async () => {
    const generator = await open('reshaped.onnx');
    const sink = (generator.sink = new ReadingSink(device));
    // The first run decides. Its inputs are compared with others, which must differ also from the middle of 0..1.
    for (const [i, timeSeconds] of [0.5, 1.3, 2.1].entries()) {
      generator.request({ timeSeconds });
      await generator.idle;
      const { values } = (await runOnCpu(`${FIXTURES}reshaped.onnx`, { timeSeconds })).gaussians;
      const error = relativeError(numbersOf(await sink.runs[i].tensors.gaussians, 'float32'), values);
      // SwiftShader's sine is good to 1e-4.
      assert(error < 1e-4, `relative error ${error} at ${timeSeconds} s`);
    }
    assertEqual(generator.kind, 'webgpu', 'kind');
  });

  itInLab(
    'driven by whole numbers alone are not either: each frame is its own, and the last stays at the end',
    async () => {
      const generator = await open('frames.onnx');
      const sink = (generator.sink = new ReadingSink(device));
      for (const [i, timeSeconds] of [0, 0.3, 0.5, 1].entries()) {
        generator.request({ timeSeconds });
        await generator.idle;
        const { values } = (await runOnCpu(`${FIXTURES}frames.onnx`, { frame: i })).gaussians;
        const found = numbersOf(await sink.runs[i].tensors.gaussians, 'float32');
        assert(relativeError(found, values) < 1e-6, `frame ${i} at ${timeSeconds} s`);
      }
    },
  );

  it('draw what the CPU would have drawn: 55 dB and more', async () => {
    const generator = await open('packed.onnx');
    const gaussians = await DynamicGaussians.create(device, generator.model.layout);
    generator.sink = gaussians;
    generator.request({ timeSeconds: 1.3 });
    await generator.idle;
    const cpu = await DynamicGaussians.create(device, generator.model.layout);
    const { values } = (await runOnCpu(`${FIXTURES}packed.onnx`, { timeSeconds: 1.3 })).gaussians;
    const buffer = device.createBuffer({ size: 4 * values.length, usage: 0x80 | 0x8 });
    device.queue.writeBuffer(buffer, 0, Float32Array.from(values));
    cpu.ingest({ gaussians: buffer }, values.length / 13);
    const renderer = new Renderer(device);
    const [live, true_] = [
      await capture(device, renderer, { gaussians, camera: CAMERA }),
      await capture(device, renderer, { gaussians: cpu, camera: CAMERA }),
    ];
    const squares = live.reduce((sum, x, i) => sum + (x - true_[i]) ** 2, 0);
    const decibels = -10 * Math.log10(squares / live.length);
    const covered = true_.filter((x, i) => i % 4 === 3 && x > 0.1).length;
    assert(covered > 300, `${covered} pixels are covered`);
    assert(decibels >= 55, `${decibels} dB`);
    for (const scene of [gaussians, cpu]) scene.destroy();
    renderer.destroy();
  });

  it('make no buffer, no pipeline, no bind group and read nothing back once they are warm', async () => {
    let frames = 0;
    const generator = await open('packed.onnx', { onFrame: () => frames++ });
    const gaussians = await DynamicGaussians.create(device, generator.model.layout);
    generator.sink = gaussians;
    for (let i = 0; i < 3; i++) {
      generator.request({ timeSeconds: i });
      await generator.idle;
    }
    const before = { ...calls };
    for (let i = 3; i < 33; i++) {
      generator.request({ timeSeconds: i });
      await generator.idle;
    }
    assertEqual(frames, 33, 'frames');
    assertEqual({ ...calls }, before, 'calls of 30 runs');
    gaussians.destroy();
  });

  it('run the latest request only, and none whose inputs have not changed', async () => {
    const shown: (number | undefined)[] = [];
    const generator = await open('packed.onnx', { onFrame: ({ state }) => shown.push(state.timeSeconds) });
    generator.sink = new ReadingSink(device);
    generator.request({ timeSeconds: 0.5 });
    await generator.idle;
    for (let i = 1; i <= 100; i++) generator.request({ timeSeconds: i });
    await generator.idle;
    generator.request({ timeSeconds: 100 });
    await generator.idle;
    assertEqual(shown, [0.5, 100], 'frames');
  });

  it('share one session, each with Gaussians of its own', async () => {
    const [a, b] = [await open('packed.onnx'), await open('packed.onnx')];
    const sinks = [new ReadingSink(device), new ReadingSink(device)];
    [a.sink, b.sink] = sinks;
    for (let i = 0; i < 5; i++) {
      a.request({ timeSeconds: i });
      b.request({ timeSeconds: i + 0.5 });
      await Promise.all([a.idle, b.idle]);
    }
    for (const [k, sink] of sinks.entries()) {
      assertEqual(sink.runs.length, 5, 'runs');
      for (const i of [0, 4]) {
        const { values } = (await runOnCpu(`${FIXTURES}packed.onnx`, { timeSeconds: i + 0.5 * k })).gaussians;
        const error = relativeError(numbersOf(await sink.runs[i].tensors.gaussians, 'float32'), values);
        assert(error < 1e-3, `instance ${k}, run ${i}: ${error}`);
      }
    }
    a.close();
    b.request({ timeSeconds: 77 });
    await b.idle;
    assertEqual(sinks[1].runs.length, 6, 'runs after the other was closed');
  });

  it('whose run fails say so, and others live on', async () => {
    const errors: unknown[] = [];
    const bad = await open('faulty-run.onnx', { onError: (error) => errors.push(error) });
    bad.sink = new ReadingSink(device);
    const good = await open('packed.onnx');
    const sink = (good.sink = new ReadingSink(device));
    for (let i = 0; i < 3; i++) {
      bad.request({ timeSeconds: i });
      good.request({ timeSeconds: i });
      await Promise.all([bad.idle, good.idle]);
    }
    assertEqual(
      errors.map((error) => (error as { code: string }).code),
      ['contract/run', 'contract/run', 'contract/run'],
    );
    assertEqual(sink.runs.length, 3, 'runs of the other');
  });

  itInLab(
    'whose runs fail again and again are back with values that they can take, and were never on the CPU',
    async () => {
      const [errors, reasons]: [string[], string[]] = [[], []];
      const options: GeneratorOptions = {
        onError: (error) => errors.push((error as { code: string }).code),
        onFallback: (reason) => reasons.push(reason),
      };
      const generator = await open('faulty-later.onnx', options);
      const sink = (generator.sink = new ReadingSink(device));
      for (const timeSeconds of [0.1, 2, 3, 4, 0.5]) {
        generator.request({ timeSeconds });
        await generator.idle;
      }
      assertEqual([errors, sink.runs.length], [['contract/run', 'contract/run', 'contract/run'], 2], 'errors, runs');
      const later = await open('faulty-later.onnx', options);
      const other = (later.sink = new ReadingSink(device));
      later.request({ timeSeconds: 0.7 });
      await later.idle;
      assertEqual([errors.length, other.runs.length, reasons], [3, 1, []], 'errors, runs of the other, fallbacks');
    },
  );

  itInLab('that run nowhere say why to each who asks, and how often', async () => {
    const errors: unknown[] = [];
    for (let i = 0; i < 2; i++) {
      const bad = await open('faulty-run.onnx', { onError: (error) => errors.push(error) });
      bad.sink = new ReadingSink(device);
      for (const timeSeconds of [i, i + 0.5]) {
        bad.request({ timeSeconds });
        await bad.idle;
      }
    }
    assertEqual(errors.length, 4, 'errors');
    for (const error of errors) assert(/Reshape node/.test(String(error)), String(error));
  });

  it('with NaN, infinity and a count above N draw the rest', async () => {
    const generator = await open('faulty-values.onnx');
    const gaussians = await DynamicGaussians.create(device, generator.model.layout);
    generator.sink = gaussians;
    generator.request({ timeSeconds: 0 });
    await generator.idle;
    const renderer = new Renderer(device);
    const pixels = await capture(device, renderer, { gaussians, camera: CAMERA });
    assert(pixels.every(Number.isFinite), 'finite pixels');
    const { unusable, visible } = await renderer.stats();
    const covered = pixels.filter((x, i) => i % 4 === 3 && x > 0.1).length;
    assert(
      covered > 300,
      `${covered} pixels are covered by ${visible} splats, ${unusable} unusable, ${generator.kind}`,
    );
    assert(unusable >= 2 && visible >= 50, `${unusable} unusable, ${visible} visible`);
    renderer.destroy();
    gaussians.destroy();
  });

  it('on a device that is lost say so, and run again on a new one', async () => {
    const own = await makeDevice();
    const errors: string[] = [];
    const onError = (error: unknown): void => void errors.push((error as { code: string }).code);
    const generator = await Generator.open({ url: `${FIXTURES}packed.onnx` }, own, { onError });
    let runs = 0;
    generator.sink = { ingest: () => void runs++ };
    generator.request({ timeSeconds: 1 });
    await generator.idle;
    assertEqual(runs, 1, 'runs');
    generator.request({ timeSeconds: 2 });
    own.destroy();
    await generator.idle;
    await own.lost;
    generator.request({ timeSeconds: 3 });
    await generator.idle;
    assertEqual(errors.at(-1), 'device-lost/unrecoverable');
    generator.close();
    const other = await open('packed.onnx');
    const next = (other.sink = new ReadingSink(device));
    other.request({ timeSeconds: 4 });
    await other.idle;
    assertEqual(next.runs.length, 1, 'runs on the other device');
  });

  it('that are closed while they run notify no listener', async () => {
    const generator = await open('packed.onnx');
    const sink = (generator.sink = new ReadingSink(device));
    generator.request({ timeSeconds: 9 });
    generator.close();
    await generator.idle;
    await delay(50);
    assertEqual(sink.runs.length, 0, 'runs');
  });
  itInLab('that are closed while they start are not started to the end', async () => {
    // A start reads back what each of its runs wrote.
    const runsOf = async (query: string, closesEarly: boolean): Promise<number> => {
      const generator = await open(`packed.onnx?${query}`);
      generator.sink = new ReadingSink(device);
      const before = calls.mapAsync;
      generator.request({ timeSeconds: 9 });
      while (calls.mapAsync === before) await delay(1);
      if (closesEarly) generator.close();
      await generator.idle;
      return calls.mapAsync - before;
    };
    const whole = await runsOf('whole', false);
    const early = await runsOf('early', true);
    assert(early < whole, `${early} runs read back, of ${whole}`);
  });

  itInLab('closed, give back all memory of the GPU, that of a captured session too', async () => {
    const alive = new Set<GPUBuffer>();
    const { createBuffer } = GPUDevice.prototype;
    const { destroy } = GPUBuffer.prototype;
    GPUDevice.prototype.createBuffer = function noting(this: GPUDevice, descriptor) {
      const buffer = createBuffer.call(this, descriptor);
      alive.add(buffer);
      return buffer;
    };
    GPUBuffer.prototype.destroy = function noting(this: GPUBuffer) {
      alive.delete(this);
      return destroy.call(this);
    };
    try {
      const left: number[] = [];
      for (let round = 0; round < 3; round++) {
        const generator = await open('canonical.onnx');
        generator.sink = new ReadingSink(device);
        for (const timeSeconds of [0, 0.3]) {
          generator.request({ timeSeconds, camera: CAMERA });
          await generator.idle;
        }
        assertEqual(generator.kind, 'captured', 'kind');
        generator.close();
        await delay(500);
        left.push(alive.size);
      }
      assertEqual(left[2], left[1], `buffers after each round: ${left}`);
    } finally {
      GPUDevice.prototype.createBuffer = createBuffer;
      GPUBuffer.prototype.destroy = destroy;
    }
  });
});
