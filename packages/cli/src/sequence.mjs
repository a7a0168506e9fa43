/** Implementation of `gaussian-splat sequence`: converts a sequence of scene files to a clip. */
import { existsSync, readFileSync, statSync } from 'node:fs';
import { resolve } from 'node:path';
import { CommandError, parseSceneOptions, report, runCommand, UsageError } from './lib/command.mjs';
import { codeClip } from '@gaussian-splat/optimize';
import { CREDIT_OPTIONS, CREDIT_USAGE, creditsWith } from './lib/credits.mjs';
import { clipJobs, openFrames, usualJobs } from './lib/clip-jobs.mjs';
import { openClipStore } from './lib/clip-store.mjs';
import { checkOutput, obstacleTo, writeWhole } from './lib/output-file.mjs';

const USAGE = `usage: gaussian-splat sequence MANIFEST --out CLIP.gsv [options]

  MANIFEST          {"gaussianSplatSequence": 1, ...}: a list of scene files; docs/sequences.md describes it
  --out CLIP.gsv    a clip: one file that is played by byte ranges. Splats may come and go; the command follows them from frame to frame
  --min-psnr DB     PSNR of each frame to its scene file, over covered pixels of 16 views together, 30 to 60 (default 45):
                    files are as small as that allows. All frames are measured. If a frame has less, the clip is written, and the status is 1
  --max-mbps RATE   most megabits a second; the PSNR may then be below the default of --min-psnr
  --per-file N      frames of a group, 2 to 480 (default 100, up to 300 if fewer than 50,000 splats move): with more, the
                    result is smaller, and its fine image comes later. Groups of large frames are shorter, so that their
                    memory is bounded
  --jobs N          groups that are encoded at the same time after the first one, 1 to 64, each in the memory of a group
                    (default: one for five CPU cores, up to 4). The result is the same
${CREDIT_USAGE.replace('SCENE', 'MANIFEST, or of the scene files')}

An interrupted command continues after its last group if it is started again: finished groups are in CLIP.gsv.unfinished.
`;

function parseOptions(args) {
  const own = { out: { type: 'string' }, 'max-mbps': { type: 'string' }, ...CREDIT_OPTIONS };
  const text = { type: 'string' };
  const parsed = parseSceneOptions(args, { ...own, 'min-psnr': text, 'per-file': text, jobs: text });
  if (parsed === undefined) return undefined;
  const { values } = parsed;
  if (values.out === undefined) throw new UsageError('--out is missing');
  const out = resolve(values.out);
  if (!/\.gsv$/i.test(out)) throw new UsageError(`--out: expected a file .gsv, found "${values.out}"`);
  checkOutput('out', out, { MANIFEST: parsed.scene }, obstacleTo);
  const minPsnr = Number(values['min-psnr'] ?? 45);
  if (!(minPsnr >= 30 && minPsnr <= 60))
    throw new UsageError(`--min-psnr: expected 30 to 60, found "${values['min-psnr']}"`);
  const wholeOf = (name, min, max) => {
    const value = values[name] === undefined ? undefined : Number(values[name]);
    if (value === undefined || (Number.isInteger(value) && value >= min && value <= max)) return value;
    throw new UsageError(`--${name}: expected a whole number from ${min} to ${max}, found "${values[name]}"`);
  };
  const framesPerGroup = wholeOf('per-file', 2, 480);
  const jobs = wholeOf('jobs', 1, 64) ?? usualJobs();
  const { 'max-mbps': rate } = values;
  if (rate !== undefined && !(Number(rate) > 0))
    throw new UsageError(`--max-mbps: expected a rate above 0, found "${rate}"`);
  const maxMbps = rate === undefined ? undefined : Number(rate);
  // A rate without a PSNR is the only demand.
  const isDemanded = maxMbps === undefined || values['min-psnr'] !== undefined;
  const { attribution, license } = values;
  const credits = { attribution, license };
  return { manifest: resolve(parsed.scene), out, minPsnr, isDemanded, maxMbps, framesPerGroup, jobs, credits };
}

async function main({ manifest, out, minPsnr, isDemanded, maxMbps, framesPerGroup, jobs, credits }) {
  const given = { manifest, minPsnr, maxMbps, framesPerGroup };
  const { sequence, paths, options } = await openFrames(given);
  const { frameCount, framesPerSecond } = sequence;
  const existing = [...new Set(paths)].filter((path) => existsSync(path));
  const store = openClipStore(out, { framesPerSecond, framesPerGroup, minPsnr, maxMbps }, existing);
  const onStep = (step) => console.log(`  ${step}`);
  const clip = await codeClip({
    ...{ ...options, store, onStep, jobs: clipJobs(jobs, given, onStep) },
    credits: creditsWith(sequence.credits, credits),
    onProgress: (frames) => console.log(`${frames} of ${frameCount} frames`),
  });
  writeWhole(out, clip.bytes);
  store.remove();
  report({ splats: clip.splats, psnr: clip.psnr });
  const sourceBytes = existing.reduce((sum, path) => sum + statSync(path).size, 0);
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
