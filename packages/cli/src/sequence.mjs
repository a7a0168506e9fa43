/** Implementation of `gaussian-splat sequence`: converts a sequence of scene files to a clip. */
import { existsSync, readFileSync } from 'node:fs';
import { basename, dirname, join, resolve } from 'node:path';
import { framePath, parseSequence, readScene } from '@gaussian-splat/formats';
import { pickInitialVariants } from '@gaussian-splat/renderer';
import { CommandError, parseSceneOptions, report, runCommand, UsageError } from './lib/command.mjs';
import { codeClip, drawOn } from '@gaussian-splat/optimize';
import { CREDIT_OPTIONS, CREDIT_USAGE, creditsWith } from './lib/credits.mjs';
import { openClipStore } from './lib/clip-store.mjs';
import { encodeWebp } from './lib/encoders.mjs';
import { requestNodeDevice } from './lib/node-gpu.mjs';
import { checkOutput, obstacleTo, writeWhole } from './lib/output-file.mjs';
import { readWhole } from './lib/input-file.mjs';

const USAGE = `usage: gaussian-splat sequence MANIFEST --out CLIP.gsv [options]

  MANIFEST          {"gaussianSplatSequence": 1, ...}: a list of scene files; docs/sequences.md describes it
  --out CLIP.gsv    a clip: one file that is played by byte ranges. Splats may come and go; the command follows them from frame to frame
  --min-psnr DB     PSNR of each frame to its scene file, over covered pixels of 16 views together, 30 to 60 (default 45):
                    files are as small as that allows. All frames are measured. If a frame has less, the clip is written, and the status is 1
  --max-mbps RATE   most megabits a second; the PSNR may then be below the default of --min-psnr
  --per-file N      frames of a group, 2 to 480 (default 100): with more, the result is smaller, and its fine image comes later.
                    Groups of large frames are shorter, so that their memory is bounded
${CREDIT_USAGE.replace('SCENE', 'MANIFEST, or of the scene files')}

An interrupted command continues after its last group if it is started again: finished groups are in CLIP.gsv.unfinished.
`;

function parseOptions(args) {
  const own = { out: { type: 'string' }, 'max-mbps': { type: 'string' }, ...CREDIT_OPTIONS };
  const parsed = parseSceneOptions(args, { ...own, 'min-psnr': { type: 'string' }, 'per-file': { type: 'string' } });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  const out = resolve(values.out);
  if (!/\.gsv$/i.test(out)) throw new UsageError(`--out: expected a file .gsv, found "${values.out}"`);
  checkOutput('out', out, { MANIFEST: parsed.scene }, obstacleTo);
  const minPsnr = Number(values['min-psnr'] ?? 45);
  if (!(minPsnr >= 30 && minPsnr <= 60))
    throw new UsageError(`--min-psnr: expected 30 to 60, found "${values['min-psnr']}"`);
  const framesPerGroup = Number(values['per-file'] ?? 100);
  if (!(Number.isInteger(framesPerGroup) && framesPerGroup >= 2 && framesPerGroup <= 480))
    throw new UsageError(`--per-file: expected a whole number from 2 to 480, found "${values['per-file']}"`);
  const { 'max-mbps': rate } = values;
  if (rate !== undefined && !(Number(rate) > 0))
    throw new UsageError(`--max-mbps: expected a rate above 0, found "${rate}"`);
  const maxMbps = rate === undefined ? undefined : Number(rate);
  // A rate without a PSNR is the only demand.
  const isDemanded = maxMbps === undefined || values['min-psnr'] !== undefined;
  const { attribution, license } = values;
  const credits = { attribution, license };
  return { manifest: resolve(parsed.scene), out, minPsnr, isDemanded, maxMbps, framesPerGroup, credits };
}

async function openDevice() {
  const { device } = await requestNodeDevice({ isTrusted: true });
  await pickInitialVariants(device, { format: 'rgba8unorm' });
  return device;
}

async function main({ manifest, out, minPsnr, isDemanded, maxMbps, framesPerGroup, credits }) {
  const sequence = parseSequence(await readWhole(manifest), basename(manifest));
  const { frameCount, framesPerSecond } = sequence;
  const paths = Array.from({ length: frameCount }, (_, frame) => join(dirname(manifest), framePath(sequence, frame)));
  const sizes = new Map();
  const openFrame = async (frame) => {
    const path = paths[frame];
    const bytes = await readWhole(path);
    sizes.set(path, bytes.length);
    return readScene(bytes, { name: path, openFile: (part) => readWhole(join(dirname(path), part)) });
  };
  const existing = paths.filter((path) => existsSync(path));
  const store = openClipStore(out, { framesPerSecond, framesPerGroup, minPsnr, maxMbps }, existing);
  const clip = await codeClip({
    ...{ frameCount, framesPerSecond, framesPerGroup, openFrame, minPsnr, maxMbps, draw: drawOn(await openDevice()) },
    ...{ encodeWebp, store },
    credits: creditsWith(sequence.credits, credits),
    onStep: (step) => console.log(`  ${step}`),
    onProgress: (frames) => console.log(`${frames} of ${frameCount} frames`),
  });
  writeWhole(out, clip.bytes);
  store.remove();
  report({ splats: clip.splats, psnr: clip.psnr });
  const sourceBytes = [...sizes.values()].reduce((sum, bytes) => sum + bytes, 0);
  const seconds = frameCount / framesPerSecond;
  const megabytes = (bytes) => `${(bytes / 1e6).toFixed(2)} MB`;
  console.log(
    `${frameCount} frames in ${megabytes(clip.bytes.length)}, ${((8e-6 * clip.bytes.length) / seconds).toFixed(2)} Mbit/s, ` +
      `${(clip.firstBytes / 1e3).toFixed(0)} kB before the first one; the scene files have ${megabytes(sourceBytes)}. ` +
      `${clip.still} splats that never change, ${clip.splats} in ${clip.groups} groups, ${clip.passing} of them in some frames only; ` +
      `${clip.psnr.toFixed(2)} dB in held-out views of ${clip.measured} frames, ${clip.worstPsnr.toFixed(2)} dB in the worst frame, ` +
      `${clip.worstViewPsnr.toFixed(2)} dB in the worst single view: ${out}`,
  );
  if (isDemanded && clip.worstPsnr < minPsnr)
    throw new CommandError(
      `${out} is written, but a frame has ${clip.worstPsnr.toFixed(2)} dB: expected ${minPsnr} dB in all frames. ` +
        'Use a lower --min-psnr, a higher --max-mbps, or frames whose splats change less from one to the next.',
    );
}

await runCommand(USAGE, parseOptions, main, {
  name: 'sequence',
  endings: ['.gsv'],
  accepts: (path) => /\.json$/i.test(path) && readFileSync(path, 'utf8').includes('"gaussianSplatSequence"'),
});
