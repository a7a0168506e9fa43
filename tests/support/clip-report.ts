/**
 * `npm run lab -- clip [options]`: the cost of a clip whose splats appear and disappear: a synthetic, seeded fountain of 150,000 splats at 30 frames a second. Prints one table of measures,
 * aims and results: the rate, the bytes before the first frame, and how long each of them takes at 2 and 8 Mbit/s.
 *
 * --splats N    splats at any time (default 150000)
 * --frames N    frames (default 300)
 * --per-file N  frames of a group (default 100)
 * --min-psnr DB PSNR of the worst frame, in its held-out views (default 45)
 * --jobs N      groups coded at the same time after the first one (default: a quarter of the CPU cores)
 * --out FILE    path of the clip (default: none)
 * --cpu         draws by plain code, 120 x 67 pixels: quicker than a software GPU for few splats
 */
import { fork } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import { availableParallelism } from 'node:os';
import { resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { codeClip, codeClipRange, drawOn, type CodeClipOptions, type CodedClip } from '@gaussian-splat/optimize';
import { CLIP_HEAD_BYTES, clipIndexBytes, parseClip, type ClipIndex } from '@gaussian-splat/formats';
import { deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { encodeWebp } from '../../packages/cli/src/lib/encoders.mjs';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { drawPlainly } from '../optimize/twin/index.js';
import { fountain } from './scenes/fountain.js';
import { remembered } from './scenes/made-clips.js';

const FRAMES_PER_SECOND = 30;
const text = (fallback: string) => ({ type: 'string', default: fallback }) as const;
const { values } = parseArgs({
  options: {
    ...{ splats: text('150000'), frames: text('300'), 'per-file': text('100'), 'min-psnr': text('45') },
    jobs: text(String(Math.max(1, Math.floor(availableParallelism() / 4)))),
    ...{ out: { type: 'string' }, cpu: { type: 'boolean', default: false } },
  },
});
const [splats, frames, framesPerGroup] = [values.splats, values.frames, values['per-file']].map(Number);

type Jobs = NonNullable<CodeClipOptions['jobs']>;
type Range = Parameters<Jobs['code']>[0];

const begin = performance.now();
const print = (step: string): void => console.error(`${((performance.now() - begin) / 1000).toFixed(0)} s: ${step}`);
let childSeconds = 0;

async function openClip(): Promise<CodeClipOptions> {
  const device = values.cpu ? undefined : await trustedDevice();
  const frameOf = remembered(fountain({ splats, frames, framesPerSecond: FRAMES_PER_SECOND }));
  return {
    ...{ frameCount: frames, framesPerSecond: FRAMES_PER_SECOND, framesPerGroup },
    minPsnr: Number(values['min-psnr']),
    openFrame: (frame) => Promise.resolve(frameOf(frame)),
    ...{ draw: device ? drawOn(device) : drawPlainly, encodeWebp },
    onStep: print,
  };
}

async function codeRange(range: Range): Promise<void> {
  const onStep = (step: string): void => print(`from ${range.begin} on: ${step}`);
  const state = await codeClipRange({ ...(await openClip()), onStep }, range);
  // Devices keep a process alive.
  process.send!({ state, cpuSeconds: cpuSeconds() }, () => process.exit(0));
}

const code: Jobs['code'] = (range) => {
  const child = fork(fileURLToPath(import.meta.url), process.argv.slice(2), { serialization: 'advanced' });
  return new Promise((done, fail) => {
    child.on('message', (own: { state: Awaited<ReturnType<Jobs['code']>>; cpuSeconds: number }) => {
      childSeconds += own.cpuSeconds;
      done(own.state);
    });
    child.on('error', fail);
    child.on('exit', (status) => fail(new Error(`frames ${range.begin} to ${range.end - 1}: status ${status}`)));
    child.send(range);
  });
};

if (process.send) process.once('message', (range: Range) => void codeRange(range));
else await report();

function cpuSeconds(): number {
  const { user, system } = process.cpuUsage();
  return 1e-6 * (user + system);
}

async function trustedDevice(): Promise<GPUDevice> {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  await pickInitialVariants(device, { format: 'rgba8unorm' });
  return device;
}

async function report(): Promise<void> {
  const clip = await codeClip({ ...(await openClip()), jobs: { count: Number(values.jobs), code } });
  if (values.out) writeFileSync(resolve(process.env.INIT_CWD ?? process.cwd(), values.out), clip.bytes);
  printTable(clip);
  process.exit(0);
}

function printTable({ bytes, firstBytes, ...clip }: CodedClip): void {
  const index = parseClip(bytes, 'a clip');
  const seconds = (performance.now() - begin) / 1000;
  const rate = (length: number): string => `${((8e-6 * length) / index.durationSeconds).toFixed(2)} Mbit/s`;
  const lengths = (of: 'sceneBytes' | 'motionBytes'): number =>
    index.groups.reduce((total, { parts }) => total + parts.reduce((own, part) => own + part[of], 0), 0);
  const head = CLIP_HEAD_BYTES + clipIndexBytes(bytes, 'a clip');
  const still = index.still.reduce((total, { sceneBytes }) => total + sceneBytes, 0);
  const coarse = index.groups[0].parts[0].splats + (index.still[0]?.splats ?? 0);
  const at = (megabits: number): string => `${secondsAt(megabits, firstBytes).toFixed(2)} s`;
  const rows = [
    ['measure', 'aim', 'seen'],
    ['splats at any time, frames, groups', '', `${splats}, ${frames}, ${index.groups.length} of ${framesPerGroup}`],
    ['splats: still, of all groups, of some frames only', '', `${clip.still}, ${clip.splats}, ${clip.passing}`],
    ['worst frame, in held-out views', `${values['min-psnr']} dB`, `${clip.worstPsnr.toFixed(2)} dB`],
    ['worst view', '', `${clip.worstViewPsnr.toFixed(2)} dB`],
    ['rate', '8 Mbit/s', rate(bytes.length)],
    ['  still, scenes, motion', '', [still, lengths('sceneBytes'), lengths('motionBytes')].map(rate).join(', ')],
    ['first frame at 2 Mbit/s', '1.7 s', at(2)],
    ['  bytes, the index included', '', `${firstBytes}, ${head} (${coarse} splats)`],
    ['first frame at 8 Mbit/s', '', at(8)],
    ['waits at 8 Mbit/s, in all', '0 s', `${waitsAt(8, index).toFixed(2)} s`],
    ['bytes', '', String(bytes.length)],
    ['CPU, time', '', `${(cpuSeconds() + childSeconds).toFixed(0)} s, ${seconds.toFixed(0)} s`],
  ];
  for (const row of rows) console.log(`| ${row.join(' | ')} |`);
}

function secondsAt(megabits: number, bytes: number): number {
  return (8e-6 * bytes) / megabits;
}

/** Seconds for which a clip stalls, because the coarse part of a group is not loaded when it is due. */
function waitsAt(megabits: number, { groups, framesPerSecond }: ClipIndex): number {
  let [late, start] = [0, 0];
  for (const { first: frame, parts } of groups) {
    const [coarse] = parts;
    const arrived = secondsAt(megabits, coarse.start + coarse.sceneBytes + coarse.motionBytes);
    if (frame === 0) start = arrived;
    late = Math.max(late, arrived - start - frame / framesPerSecond);
  }
  return late;
}
