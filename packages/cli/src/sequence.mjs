/**
 * Implementation of `gaussian-splat sequence`: converts a sequence of scene files with corresponding splats to a scene
 * and its motion.
 */
import { existsSync, mkdirSync, readdirSync, statSync, writeFileSync } from 'node:fs';
import { basename, dirname, join, resolve } from 'node:path';
import { framePath, parseSequence, readScene } from '@gaussian-splat/formats';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { from, parseSceneOptions, runCommand, UsageError } from './lib/command.mjs';
import { codeClip, codeSequence } from '@gaussian-splat/economise';
import { deflate, deflateQuickly, encodeWebp } from './lib/encoders.mjs';
import { requestNodeAdapter } from './lib/node-gpu.mjs';
import { writeWhole } from './lib/output-file.mjs';
import { readWhole } from './lib/input-file.mjs';

const USAGE = `usage: gaussian-splat sequence MANIFEST --out CLIP.gsv|FOLDER [options]

  MANIFEST          {"gaussianSplatSequence": 1, ...}: scene files of any splats, docs/sequences.md describes it
  --out CLIP.gsv    a clip: one file that is played by byte ranges. Splats may come and go; those of a frame are found in the next one
  --out FOLDER      an empty folder, or one that does not exist yet, for frames that have the same splats in the same order: sequence.json, first.sog and files of motion
  --min-db DB       PSNR of frames to the scene files, over covered pixels, 30 to 60 (default 45): files are as small as that allows
  --max-mbps RATE   of a clip: megabits that a second takes at most, whatever that costs of the PSNR
  --per-file N      frames of a file of motion, or of a group of a clip, 2 to 480 (default 48): the more, the smaller all of it, and the longer until the second frame
`;

function parseOptions(args) {
  const text = (fallback) => ({ type: 'string', default: fallback });
  const own = { out: { type: 'string' }, 'max-mbps': { type: 'string' } };
  const parsed = parseSceneOptions(args, { ...own, 'min-db': text('45'), 'per-file': text('48') });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  const out = resolve(from, values.out);
  const isClip = /\.gsv$/i.test(out);
  if (!isClip && existsSync(out) && !statSync(out).isDirectory())
    throw new UsageError(`--out: ${values.out} is no folder`);
  if (!isClip && existsSync(out) && readdirSync(out).length > 0)
    throw new UsageError(`--out: ${values.out} is not empty`);
  const minDecibels = Number(values['min-db']);
  if (!(minDecibels >= 30 && minDecibels <= 60))
    throw new UsageError(`--min-db: expected 30 to 60, found "${values['min-db']}"`);
  const framesPerFile = Number(values['per-file']);
  if (!(Number.isInteger(framesPerFile) && framesPerFile >= 2 && framesPerFile <= 480))
    throw new UsageError(`--per-file: expected a whole number from 2 to 480, found "${values['per-file']}"`);
  const { 'max-mbps': rate } = values;
  if (rate !== undefined && !isClip) throw new UsageError('--max-mbps: expected with --out CLIP.gsv');
  if (rate !== undefined && !(Number(rate) > 0))
    throw new UsageError(`--max-mbps: expected a rate above 0, found "${rate}"`);
  const maxMbps = rate === undefined ? undefined : Number(rate);
  return { manifest: resolve(from, parsed.scene), out, isClip, minDecibels, maxMbps, framesPerFile };
}

async function openDevice() {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  await pickInitialVariants(device, { format: 'rgba8unorm' });
  return device;
}

async function main({ manifest, out, isClip, minDecibels, maxMbps, framesPerFile }) {
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
    ...{ frameCount, framesPerSecond, openFrame, minDecibels, device: await openDevice() },
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
      `${clip.decibels.toFixed(2)} dB in held-out views of frames, ${clip.worstDecibels.toFixed(2)} dB in the worst: ${out}`,
  );
}

async function writeFolder(options, out) {
  const { frameCount, framesPerSecond, framesPerFile } = options;
  const { first, files, decibels, worstDecibels } = await codeSequence(options);
  mkdirSync(out, { recursive: true });
  writeFileSync(join(out, 'first.sog'), first);
  const digits = String(Math.max(0, files.length - 1)).length;
  files.forEach((file, k) => writeFileSync(join(out, `motion-${String(k).padStart(digits, '0')}.bin`), file));
  const described = {
    ...{ gaussianSplatSequence: 2, framesPerSecond, count: frameCount, first: 'first.sog' },
    ...{ motion: `motion-{${'0'.repeat(digits)}}.bin`, framesPerFile },
  };
  writeWhole(join(out, 'sequence.json'), `${JSON.stringify(described)}\n`);
  const bytes = files.reduce((sum, { length }) => sum + length, first.length);
  console.log(
    `${frameCount} frames in ${(bytes / 1e6).toFixed(2)} MB, ${(first.length / 1e3).toFixed(0)} kB before the first one; ` +
      `${decibels.toFixed(2)} dB in held-out views of frames, ${worstDecibels.toFixed(2)} dB in the worst: ${join(out, 'sequence.json')}`,
  );
}

await runCommand(USAGE, parseOptions, main);
