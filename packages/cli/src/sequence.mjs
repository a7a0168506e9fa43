/**
 * Implementation of `gaussian-splat sequence`: converts a sequence of scene files with corresponding splats to a scene
 * and its motion.
 */
import { existsSync, readdirSync } from 'node:fs';
import { basename, dirname, join, resolve } from 'node:path';
import { framePath, parseSequence, readScene } from '@gaussian-splat/formats';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { parseSceneOptions, runCommand, UsageError } from './lib/command.mjs';
import { codeClip, codeSequence } from '@gaussian-splat/economise';
import { deflate, deflateQuickly, encodeWebp } from './lib/encoders.mjs';
import { requestNodeAdapter } from './lib/node-gpu.mjs';
import { checkOutput, obstacleTo, obstacleToFolder, writeAll, writeWhole } from './lib/output-file.mjs';
import { readWhole } from './lib/input-file.mjs';

const USAGE = `usage: gaussian-splat sequence MANIFEST --out CLIP.gsv|FOLDER [options]

  MANIFEST          {"gaussianSplatSequence": 1, ...}: a list of scene files; docs/sequences.md describes it
  --out CLIP.gsv    a clip: one file that is played by byte ranges. Splats may come and go; the command follows them from frame to frame
  --out FOLDER      an empty folder, or one that does not exist yet, for frames that have the same splats in the same order: sequence.json, first.sog and files of motion
  --min-psnr DB     PSNR of frames to the scene files, over covered pixels, 30 to 60 (default 45): files are as small as that allows
  --max-mbps RATE   of a clip: most megabits a second; the PSNR may then be below --min-psnr
  --per-file N      frames of a file of motion, or of a group of a clip, 2 to 480 (default 48, of a clip 100): with more, the result is smaller, and the second frame comes later
`;

function parseOptions(args) {
  const text = (fallback) => ({ type: 'string', default: fallback });
  const own = { out: { type: 'string' }, 'max-mbps': { type: 'string' } };
  const parsed = parseSceneOptions(args, { ...own, 'min-psnr': text('45'), 'per-file': { type: 'string' } });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  const out = resolve(values.out);
  const isClip = /\.gsv$/i.test(out);
  checkOutput('out', out, { MANIFEST: parsed.scene }, isClip ? obstacleTo : obstacleToFolder);
  if (!isClip && existsSync(out) && readdirSync(out).length > 0)
    throw new UsageError(`--out: ${values.out} is not empty`);
  const minPsnr = Number(values['min-psnr']);
  if (!(minPsnr >= 30 && minPsnr <= 60))
    throw new UsageError(`--min-psnr: expected 30 to 60, found "${values['min-psnr']}"`);
  const framesPerFile = Number(values['per-file'] ?? (isClip ? 100 : 48));
  if (!(Number.isInteger(framesPerFile) && framesPerFile >= 2 && framesPerFile <= 480))
    throw new UsageError(`--per-file: expected a whole number from 2 to 480, found "${values['per-file']}"`);
  const { 'max-mbps': rate } = values;
  if (rate !== undefined && !isClip) throw new UsageError('--max-mbps: expected with --out CLIP.gsv');
  if (rate !== undefined && !(Number(rate) > 0))
    throw new UsageError(`--max-mbps: expected a rate above 0, found "${rate}"`);
  const maxMbps = rate === undefined ? undefined : Number(rate);
  return { manifest: resolve(parsed.scene), out, isClip, minPsnr, maxMbps, framesPerFile };
}

async function openDevice() {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  await pickInitialVariants(device, { format: 'rgba8unorm' });
  return device;
}

async function main({ manifest, out, isClip, minPsnr, maxMbps, framesPerFile }) {
  const sequence = parseSequence(await readWhole(manifest), basename(manifest));
  if (sequence.motion) throw new UsageError(`${basename(manifest)}: expected scene files, found files of motion`);
  const { frameCount, framesPerSecond } = sequence;
  let sourceBytes = 0;
  const openFrame = async (frame) => {
    const path = join(dirname(manifest), framePath(sequence, frame));
    const bytes = await readWhole(path);
    sourceBytes += bytes.length;
    return readScene(bytes, { name: path, openFile: (part) => readWhole(join(dirname(path), part)) });
  };
  const options = {
    ...{ frameCount, framesPerSecond, openFrame, minPsnr, device: await openDevice() },
    ...{ encodeWebp, deflate, deflateQuickly },
    onStep: (step) => console.log(`  ${step}`),
  };
  if (isClip) await writeClip({ ...options, framesPerGroup: framesPerFile, maxMbps }, out, () => sourceBytes);
  else await writeFolder({ ...options, framesPerFile }, out);
}

async function writeClip(options, out, sourceBytes) {
  const { frameCount, framesPerSecond } = options;
  const clip = await codeClip(options);
  writeWhole(out, clip.bytes);
  const seconds = frameCount / framesPerSecond;
  const megabytes = (bytes) => `${(bytes / 1e6).toFixed(2)} MB`;
  console.log(
    `${frameCount} frames in ${megabytes(clip.bytes.length)}, ${((8e-6 * clip.bytes.length) / seconds).toFixed(2)} Mbit/s, ` +
      `${(clip.firstBytes / 1e3).toFixed(0)} kB before the first one; the scene files have ${megabytes(sourceBytes())}. ` +
      `${clip.splats} splats in ${clip.groups} groups, ${clip.passing} of them in some frames only; ` +
      `${clip.psnr.toFixed(2)} dB in held-out views of frames, ${clip.worstPsnr.toFixed(2)} dB in the worst: ${out}`,
  );
}

async function writeFolder(options, out) {
  const { frameCount, framesPerSecond, framesPerFile } = options;
  const { first, files, psnr, worstPsnr } = await codeSequence(options);
  const digits = String(Math.max(0, files.length - 1)).length;
  const motion = files.map((file, k) => [join(out, `motion-${String(k).padStart(digits, '0')}.bin`), file]);
  const described = {
    ...{ gaussianSplatSequence: 2, framesPerSecond, count: frameCount, first: 'first.sog' },
    ...{ motion: `motion-{${'0'.repeat(digits)}}.bin`, framesPerFile },
  };
  const manifest = [join(out, 'sequence.json'), `${JSON.stringify(described)}\n`];
  writeAll([[join(out, 'first.sog'), first], ...motion, manifest]);
  const bytes = files.reduce((sum, { length }) => sum + length, first.length);
  console.log(
    `${frameCount} frames in ${(bytes / 1e6).toFixed(2)} MB, ${(first.length / 1e3).toFixed(0)} kB before the first one; ` +
      `${psnr.toFixed(2)} dB in held-out views of frames, ${worstPsnr.toFixed(2)} dB in the worst: ${join(out, 'sequence.json')}`,
  );
}

await runCommand(USAGE, parseOptions, main);
