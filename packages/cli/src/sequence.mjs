/** Implementation of `gaussian-splat sequence`: converts a sequence of scene files to a clip. */
import { basename, dirname, join, resolve } from 'node:path';
import { framePath, parseSequence, readScene } from '@gaussian-splat/formats';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { parseSceneOptions, runCommand, UsageError } from './lib/command.mjs';
import { codeClip } from '@gaussian-splat/economise';
import { deflate, encodeWebp } from './lib/encoders.mjs';
import { requestNodeAdapter } from './lib/node-gpu.mjs';
import { checkOutput, obstacleTo, writeWhole } from './lib/output-file.mjs';
import { readWhole } from './lib/input-file.mjs';

const USAGE = `usage: gaussian-splat sequence MANIFEST --out CLIP.gsv [options]

  MANIFEST          {"gaussianSplatSequence": 1, ...}: a list of scene files; docs/sequences.md describes it
  --out CLIP.gsv    a clip: one file that is played by byte ranges. Splats may come and go; the command follows them from frame to frame
  --min-psnr DB     PSNR of frames to the scene files, over covered pixels, 30 to 60 (default 45): files are as small as that allows
  --max-mbps RATE   most megabits a second; the PSNR may then be below --min-psnr
  --per-file N      frames of a group, 2 to 480 (default 100): with more, the result is smaller, and its fine image comes later
`;

function parseOptions(args) {
  const text = (fallback) => ({ type: 'string', default: fallback });
  const own = { out: { type: 'string' }, 'max-mbps': { type: 'string' } };
  const parsed = parseSceneOptions(args, { ...own, 'min-psnr': text('45'), 'per-file': { type: 'string' } });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  const out = resolve(values.out);
  if (!/\.gsv$/i.test(out)) throw new UsageError(`--out: expected a file .gsv, found "${values.out}"`);
  checkOutput('out', out, { MANIFEST: parsed.scene }, obstacleTo);
  const minPsnr = Number(values['min-psnr']);
  if (!(minPsnr >= 30 && minPsnr <= 60))
    throw new UsageError(`--min-psnr: expected 30 to 60, found "${values['min-psnr']}"`);
  const framesPerGroup = Number(values['per-file'] ?? 100);
  if (!(Number.isInteger(framesPerGroup) && framesPerGroup >= 2 && framesPerGroup <= 480))
    throw new UsageError(`--per-file: expected a whole number from 2 to 480, found "${values['per-file']}"`);
  const { 'max-mbps': rate } = values;
  if (rate !== undefined && !(Number(rate) > 0))
    throw new UsageError(`--max-mbps: expected a rate above 0, found "${rate}"`);
  const maxMbps = rate === undefined ? undefined : Number(rate);
  return { manifest: resolve(parsed.scene), out, minPsnr, maxMbps, framesPerGroup };
}

async function openDevice() {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  await pickInitialVariants(device, { format: 'rgba8unorm' });
  return device;
}

async function main({ manifest, out, minPsnr, maxMbps, framesPerGroup }) {
  const sequence = parseSequence(await readWhole(manifest), basename(manifest));
  const { frameCount, framesPerSecond } = sequence;
  let sourceBytes = 0;
  const openFrame = async (frame) => {
    const path = join(dirname(manifest), framePath(sequence, frame));
    const bytes = await readWhole(path);
    sourceBytes += bytes.length;
    return readScene(bytes, { name: path, openFile: (part) => readWhole(join(dirname(path), part)) });
  };
  const clip = await codeClip({
    ...{ frameCount, framesPerSecond, framesPerGroup, openFrame, minPsnr, maxMbps, device: await openDevice() },
    ...{ encodeWebp, deflate },
    onStep: (step) => console.log(`  ${step}`),
  });
  writeWhole(out, clip.bytes);
  const seconds = frameCount / framesPerSecond;
  const megabytes = (bytes) => `${(bytes / 1e6).toFixed(2)} MB`;
  console.log(
    `${frameCount} frames in ${megabytes(clip.bytes.length)}, ${((8e-6 * clip.bytes.length) / seconds).toFixed(2)} Mbit/s, ` +
      `${(clip.firstBytes / 1e3).toFixed(0)} kB before the first one; the scene files have ${megabytes(sourceBytes)}. ` +
      `${clip.splats} splats in ${clip.groups} groups, ${clip.passing} of them in some frames only; ` +
      `${clip.psnr.toFixed(2)} dB in held-out views of frames, ${clip.worstPsnr.toFixed(2)} dB in the worst: ${out}`,
  );
}

await runCommand(USAGE, parseOptions, main);
