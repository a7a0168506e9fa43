/**
 * `npm run lab -- clip-errors [options]`: the accuracy that the encoder of clips prints, of the worst frame and of the worst
 * view, beside that of all frames in views that it has not drawn. A line of JSON for each of the clips of scenes/made-clips.ts.
 *
 * --only A,B    clips (default: the ten that change in one way each)
 * --splats N    splats of each (default 20000)
 * --frames N    frames (default 40); --per-file N: frames of a group (default: all)
 * --min-psnr DB target (default 45); --max-mbps RATE: most megabits a second
 * --views N     views of each frame that judge the result (default 24)
 * --jobs N      clips at a time (default 1)
 * --coded FILE  judges this clip, in place of encoding one
 * --cpu         draws by plain code, 120 x 67 pixels: quicker than a software GPU for few splats
 * --write DIR   writes the frames as PLY files with a frames.json, for `gaussian-splat sequence`, and no clip
 */
import { fork } from 'node:child_process';
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { boundsOf } from '@gaussian-splat/core';
import { parseClip } from '@gaussian-splat/formats';
import { codeClip, decibels, drawOn, encodingsFor, viewsAround, type DrawFrame } from '@gaussian-splat/optimize';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { encodeWebp } from '../../packages/cli/src/lib/encoders.mjs';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { drawPlainly } from '../optimize/twin/index.js';
import { framesOf } from './clips.js';
import { MADE_CLIPS, remembered, type FrameOf } from './scenes/made-clips.js';

const FRAMES_PER_SECOND = 30;
/** Seed of the judging views; the encoder has others. */
const SEED = 100_000;
const text = (fallback: string) => ({ type: 'string', default: fallback }) as const;
const optional = { type: 'string' } as const;
const { values } = parseArgs({
  options: {
    ...{ only: text(Object.keys(MADE_CLIPS).slice(0, 10).join()), splats: text('20000'), frames: text('40') },
    ...{ 'per-file': optional, 'min-psnr': text('45'), 'max-mbps': optional, views: text('24'), jobs: text('1') },
    ...{ write: optional, coded: optional, cpu: { type: 'boolean', default: false } },
    // A process that another one started has its clip, or some frames to write.
    ...{ clip: optional, part: optional },
  },
});
const [splats, frames, jobs] = [values.splats, values.frames, values.jobs].map(Number);

if (values.clip !== undefined) await (values.part ? writeFrames(values.clip, Number(values.part)) : judge(values.clip));
else if (values.write !== undefined) await writeAll(values.only, values.write);
else await judgeAll(values.only.split(','));

/** Starts this file again with options of its own; resolves with its status. */
function started(own: Record<string, string>): Promise<number | null> {
  const given = Object.entries({ ...values, ...own }).filter(([, value]) => value !== false);
  const words = given.map(([name, value]) => (value === true ? `--${name}` : `--${name}=${value}`));
  const child = fork(fileURLToPath(import.meta.url), words);
  return new Promise((done) => child.on('exit', (status) => done(status)));
}

async function judgeAll(names: readonly string[]): Promise<void> {
  const rest = [...names];
  const next = async (): Promise<void> => {
    for (let clip = rest.shift(); clip; clip = rest.shift()) {
      const status = await started({ clip });
      if (status !== 0) console.log(JSON.stringify({ clip, ended: status }));
    }
  };
  await Promise.all(Array.from({ length: jobs }, next));
}

/** Encodes a clip, or reads it, and prints its row. */
async function judge(clip: string): Promise<void> {
  const draw = values.cpu ? drawPlainly : await drawOnGpu();
  const frameOf = remembered(await MADE_CLIPS[clip]({ splats, frames }));
  const { bytes, ...printed } = values.coded
    ? { bytes: readFileSync(values.coded) }
    : await encoded(clip, frameOf, draw);
  const found = await errorsIn(bytes, frameOf, draw);
  const frameErrors = found.map(average);
  const worst = Math.max(...frameErrors);
  const { groups, still } = parseClip(bytes, clip);
  const scenes = [still, ...groups.map(({ parts }) => parts)].map((parts) =>
    parts.reduce((sum, { sceneBytes }) => sum + sceneBytes, 0),
  );
  const { userCPUTime, systemCPUTime, maxRSS } = process.resourceUsage();
  const row = {
    ...{ clip, splats, frames, minPsnr: Number(values['min-psnr']), ...printed },
    ...{ worst: decibels(worst), frame: frameErrors.indexOf(worst), worstView: decibels(Math.max(...found.flat())) },
    mean: decibels(average(frameErrors)),
    ...{ bytes: bytes.length, mbps: (8e-6 * bytes.length * FRAMES_PER_SECOND) / frames, groups: groups.length },
    // All scenes of the clip, relative to those that its first group needs.
    scenes: scenes.reduce((sum, own) => sum + own, 0) / (scenes[0] + scenes[1]),
    ...{ cpuSeconds: 1e-6 * (userCPUTime + systemCPUTime), peakMb: maxRSS / 1000 },
  };
  const rounded = (_: string, value: unknown): unknown =>
    typeof value === 'number' ? Number(value.toFixed(2)) : value;
  console.log(JSON.stringify(row, rounded));
  // Devices keep a process alive.
  process.exit(0);
}

async function encoded(clip: string, frameOf: FrameOf, draw: DrawFrame) {
  const coded = await codeClip({
    ...{ frameCount: frames, framesPerSecond: FRAMES_PER_SECOND, framesPerGroup: Number(values['per-file'] ?? frames) },
    ...{ minPsnr: Number(values['min-psnr']), draw, encodeWebp },
    maxMbps: values['max-mbps'] === undefined ? undefined : Number(values['max-mbps']),
    openFrame: (frame) => Promise.resolve(frameOf(frame)),
    onStep: (step) => console.error(`${clip}: ${step}`),
  });
  const { bytes, worstPsnr: printed, worstViewPsnr: printedView, psnr: printedMean, still, passing } = coded;
  return { bytes, printed, printedView, printedMean, still, passing };
}

/** Returns the errors of each frame, in each view that shows something. */
async function errorsIn(bytes: Uint8Array, frameOf: FrameOf, draw: DrawFrame): Promise<(readonly number[])[]> {
  const shown = framesOf(bytes);
  const found: (readonly number[])[] = [];
  for (let frame = 0; frame < frames; frame++) {
    const source = frameOf(frame);
    const images = await draw(source, viewsAround(boundsOf(source), Number(values.views), { seed: SEED + 31 * frame }));
    found.push(await images.compare(await shown(frame)));
    images.destroy();
  }
  return found;
}

function average(errors: readonly number[]): number {
  return errors.reduce((sum, error) => sum + error, 0) / errors.length;
}

async function drawOnGpu(): Promise<DrawFrame> {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  await pickInitialVariants(device, { format: 'rgba8unorm' });
  return drawOn(device);
}

async function writeAll(clip: string, folder: string): Promise<void> {
  mkdirSync(folder, { recursive: true });
  const statuses = await Promise.all(Array.from({ length: jobs }, (_, part) => started({ clip, part: String(part) })));
  if (statuses.some((status) => status !== 0)) throw new Error(`Writing frames failed: ${statuses.join(', ')}.`);
  const sequence = {
    gaussianSplatSequence: 1,
    framesPerSecond: FRAMES_PER_SECOND,
    frames: '{0000}.ply',
    count: frames,
  };
  writeFileSync(join(folder, 'frames.json'), JSON.stringify(sequence));
}

async function writeFrames(clip: string, part: number): Promise<void> {
  const frameOf = await MADE_CLIPS[clip]({ splats, frames });
  const ply = encodingsFor('a.ply')[0];
  for (let frame = part; frame < frames; frame += jobs) {
    const cloud = frameOf(frame);
    const bytes = await ply.write({ cloud, degrees: new Uint8Array(cloud.count).fill(cloud.shDegree) });
    writeFileSync(join(values.write!, `${String(frame).padStart(4, '0')}.ply`), bytes);
  }
}
