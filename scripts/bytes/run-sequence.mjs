/**
 * `npm run lab:sequence`: the cost of a sequence whose splats correspond: ten seconds of the walker that ships, 240 frames of 40,000 splats, as its first frame and the motion after it,
 * and the same frames as files of their own.
 */
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import * as ort from 'onnxruntime-web';
import { quaternionOfMatrix, symmetricEigen } from '@gaussian-splat/core';
import { resolveContract } from '@gaussian-splat/core/contract';
import { bytesSource, readOnnxHeader } from '@gaussian-splat/core/onnx';
import { codeSequence, encodingsFor } from '@gaussian-splat/economise';
import { bindInputs } from '@gaussian-splat/generator';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { walkingPose } from '../../demo/examples/poses.js';
import { deflate, deflateQuickly, encodeWebp } from '../../packages/cli/src/lib/encoders.mjs';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { root } from '../lib/run.mjs';

const USAGE = `usage: npm run lab:sequence -- [options]

  --out FOLDER    where the sequence is written (default bench-results/sequence)
  --frames N      default 240
  --min-psnr DB   default 45
  --per-file N    default 48
`;
const text = (fallback) => ({ type: 'string', default: fallback });
const { values } = parseArgs({
  options: {
    ...{
      out: text(join(root, 'bench-results/sequence')),
      frames: text('240'),
      'min-psnr': text('45'),
      'per-file': text('48'),
    },
    help: { type: 'boolean' },
  },
});
if (values.help) {
  console.log(USAGE);
  process.exit(0);
}

const FRAMES_PER_SECOND = 24;
/** Frames of each leg's gait cycle: not a whole fraction of a second, so that all frames differ. */
const QUALITY = 26.5;
/** Value of the constant spherical harmonic. */
const SH_CONSTANT = 0.28209479177387814;

const model = new Uint8Array(readFileSync(join(root, 'demo/generators/walker/model.onnx')));
const header = await readOnnxHeader(bytesSource(model, 'walker'));
const { contract } = resolveContract({ header });
ort.env.logLevel = 'error';
ort.env.wasm.numThreads = 1;
const session = await ort.InferenceSession.create(model, { executionProviders: ['wasm'], logSeverityLevel: 3 });

/** The walker in one frame, as a `GaussianCloud`. */
async function openFrame(frame) {
  const { joints } = contract.inputs.pose;
  const state = { timeSeconds: 0, pose: walkingPose(joints, (frame / QUALITY) % 1) };
  const inputs = Object.entries(bindInputs(header, contract, state));
  const feeds = Object.fromEntries(
    inputs.map(([name, { data, dims }]) => [name, new ort.Tensor('float32', data, dims)]),
  );
  const outputs = await session.run(feeds);
  const [positions, covariances, colors, opacities] = ['positions', 'covariances', 'colors', 'opacities'].map(
    (name) => outputs[name].data,
  );
  const count = opacities.length;
  const cloud = {
    ...{ count, origin: [0, 0, 0], shDegree: 0, antialiased: false, droppedCount: 0 },
    positions: new Float32Array(positions),
    scales: new Float32Array(3 * count),
    rotations: new Float32Array(4 * count),
    opacities: new Float32Array(opacities),
    sh: Float32Array.from(colors, (value) => (value - 0.5) / SH_CONSTANT),
  };
  for (let i = 0; i < count; i++) {
    const [xx, xy, xz, yy, yz, zz] = covariances.subarray(6 * i, 6 * i + 6);
    const { values: variances, vectors } = symmetricEigen([xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    cloud.scales.set(
      variances.map((variance) => Math.sqrt(Math.max(0, variance))),
      3 * i,
    );
    cloud.rotations.set(quaternionOfMatrix(vectors), 4 * i);
  }
  return cloud;
}

const adapter = await requestNodeAdapter({ isTrusted: true });
const device = await adapter.requestDevice(deviceDescriptor(adapter));
await pickInitialVariants(device, { format: 'rgba8unorm' });
const frameCount = Number(values.frames);
const framesPerFile = Number(values['per-file']);
const options = { frameCount, openFrame, framesPerFile, minPsnr: Number(values['min-psnr']), device };
const begun = performance.now();
const { first, files, psnr, worstPsnr } = await codeSequence({
  ...options,
  ...{ encodeWebp, deflate, deflateQuickly },
  onStep: (step) => console.log(`  ${step}`),
});
const whole = await openFrame(Math.floor(frameCount / 2));
const degrees = new Uint8Array(whole.count);
const own = (await encodingsFor('a.spz').at(-1).write({ cloud: whole, degrees })).length;
mkdirSync(values.out, { recursive: true });
writeFileSync(join(values.out, 'first.sog'), first);
files.forEach((file, k) => writeFileSync(join(values.out, `motion-${k}.bin`), file));
const manifest = {
  ...{ gaussianSplatSequence: 2, framesPerSecond: FRAMES_PER_SECOND, count: frameCount },
  ...{ first: 'first.sog', motion: 'motion-{0}.bin', framesPerFile },
};
writeFileSync(join(values.out, 'sequence.json'), JSON.stringify(manifest));
const all = files.reduce((sum, { length }) => sum + length, first.length);
console.log(`
splats         ${whole.count} in ${frameCount} frames
first frame    ${first.length} bytes
second frame   ${first.length + files[0].length} bytes
all            ${(all / 1e6).toFixed(3)} MB; as SPZ of each frame ${((own * frameCount) / 1e6).toFixed(1)} MB
accuracy       ${psnr.toFixed(2)} dB in held-out views of frames, ${worstPsnr.toFixed(2)} dB in the worst
seconds        ${((performance.now() - begun) / 1000).toFixed(0)}`);
process.exit(0);
