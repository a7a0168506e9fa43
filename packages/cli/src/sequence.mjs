/** The work behind `gaussian-splat sequence`: a sequence of scene files whose splats correspond becomes a scene and what moves in it. */
import { existsSync, mkdirSync, readdirSync, statSync, writeFileSync } from 'node:fs';
import { basename, dirname, join, resolve } from 'node:path';
import { framePath, parseSequence, readScene } from '@gaussian-splat/formats';
import { deviceDescriptor, startVariants } from '@gaussian-splat/renderer';
import { from, parseSceneOptions, runCommand, UsageError } from './lib/command.mjs';
import { codeSequence } from '@gaussian-splat/economise';
import { deflate, deflateQuickly, encodeWebp } from './lib/encoders.mjs';
import { requestNodeAdapter } from './lib/node-gpu.mjs';
import { writeWhole } from './lib/output-file.mjs';
import { readWhole } from './lib/input-file.mjs';

const USAGE = `usage: gaussian-splat sequence MANIFEST --out FOLDER [options]

  MANIFEST        {"gaussianSplatSequence": 1, ...}: scene files that have the same splats, in the same order
  --out FOLDER    an empty folder, or one that does not exist yet: sequence.json, first.sog and files of motion, docs/sequences.md describes them
  --min-db DB     PSNR of frames to the scene files, over covered pixels, 30 to 60 (default 45): files are as small as that allows
  --per-file N    frames of a file of motion, 2 to 480 (default 48): the more, the smaller all files together, and the longer until the second frame
`;

function parseOptions(args) {
  const text = (fallback) => ({ type: 'string', default: fallback });
  const parsed = parseSceneOptions(args, { out: { type: 'string' }, 'min-db': text('45'), 'per-file': text('48') });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  const out = resolve(from, values.out);
  if (existsSync(out) && !statSync(out).isDirectory()) throw new UsageError(`--out: ${values.out} is no folder`);
  if (existsSync(out) && readdirSync(out).length > 0) throw new UsageError(`--out: ${values.out} is not empty`);
  const minDecibels = Number(values['min-db']);
  if (!(minDecibels >= 30 && minDecibels <= 60))
    throw new UsageError(`--min-db: expected 30 to 60, found "${values['min-db']}"`);
  const framesPerFile = Number(values['per-file']);
  if (!(Number.isInteger(framesPerFile) && framesPerFile >= 2 && framesPerFile <= 480))
    throw new UsageError(`--per-file: expected a whole number from 2 to 480, found "${values['per-file']}"`);
  return { manifest: resolve(from, parsed.scene), out, minDecibels, framesPerFile };
}

async function openDevice() {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  await startVariants(device, { format: 'rgba8unorm' });
  return device;
}

async function main({ manifest, out, minDecibels, framesPerFile }) {
  const sequence = parseSequence(await readWhole(manifest), basename(manifest));
  if (sequence.motion) throw new UsageError(`${basename(manifest)}: expected scene files, found files of motion`);
  const { frameCount, framesPerSecond } = sequence;
  const openFrame = async (frame) => {
    const path = join(dirname(manifest), framePath(sequence, frame));
    return readScene(await readWhole(path), { name: path, openPart: (part) => readWhole(join(dirname(path), part)) });
  };
  const { first, files, decibels, worstDecibels } = await codeSequence({
    ...{ frameCount, openFrame, framesPerFile, minDecibels, device: await openDevice() },
    ...{ encodeWebp, deflate, deflateQuickly },
    onStep: (step) => console.log(`  ${step}`),
  });
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
