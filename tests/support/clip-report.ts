/**
 * `npm run lab -- clip [options]`: the cost of a clip whose splats appear and disappear: a synthetic, seeded fountain of 150,000 splats at 30 frames a second. Prints one table of measures,
 * aims and results: the rate, the bytes before the first frame, and how long each of them takes at 2 and 8 Mbit/s.
 *
 * --splats N    splats at any time (default 150000)
 * --frames N    frames (default 300)
 * --per-file N  frames of a group (default 100)
 * --min-psnr DB PSNR of the worst frame, in its held-out views (default 45)
 * --jobs N      processes that code the groups (default: a quarter of the CPU cores); each finds its own rounding
 * --out FILE    path of the clip (default: none)
 * --cpu         draws by plain code, 120 x 67 pixels: quicker than a software GPU for few splats
 */
import { fork } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { availableParallelism, tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { codeClip, drawOn, type CodedClip } from '@gaussian-splat/optimize';
import { CLIP_HEAD_BYTES, clipIndexBytes, parseClip, writeClipHead, type ClipIndex } from '@gaussian-splat/formats';
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
    // Frames of a process that another one started.
    ...{ from: { type: 'string' }, until: { type: 'string' } },
  },
});
const [splats, frames, framesPerGroup] = [values.splats, values.frames, values['per-file']].map(Number);

/** Statistics of a process for the frames that it coded. */
interface Facts extends Omit<CodedClip, 'bytes'> {
  readonly cpuSeconds: number;
}

if (values.from === undefined) await report();
else await codeFrames(Number(values.from), Number(values.until), values.out!);

async function codeFrames(from: number, until: number, out: string): Promise<void> {
  const device = values.cpu ? undefined : await trustedDevice();
  const frameOf = remembered(fountain({ splats, frames, framesPerSecond: FRAMES_PER_SECOND }));
  const begin = performance.now();
  const { bytes, ...facts } = await codeClip({
    ...{ frameCount: until - from, framesPerSecond: FRAMES_PER_SECOND, framesPerGroup },
    minPsnr: Number(values['min-psnr']),
    openFrame: (frame) => Promise.resolve(frameOf(from + frame)),
    ...{ draw: device ? drawOn(device) : drawPlainly, encodeWebp },
    onStep: (step) => console.error(`${((performance.now() - begin) / 1000).toFixed(0)} s, from ${from} on: ${step}`),
  });
  writeFileSync(out, bytes);
  const { user, system } = process.cpuUsage();
  process.send!({ ...facts, cpuSeconds: 1e-6 * (user + system) } satisfies Facts);
  device?.destroy();
  process.disconnect();
}

async function trustedDevice(): Promise<GPUDevice> {
  const adapter = await requestNodeAdapter({ isTrusted: true });
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  await pickInitialVariants(device, { format: 'rgba8unorm' });
  return device;
}

async function report(): Promise<void> {
  const folder = mkdtempSync(join(tmpdir(), 'clip-'));
  const begin = performance.now();
  try {
    const groups = Math.ceil(frames / framesPerGroup);
    const jobs = Math.max(1, Math.min(groups, Number(values.jobs)));
    const edge = (job: number): number => Math.min(frames, framesPerGroup * Math.round((groups * job) / jobs));
    const files = Array.from({ length: jobs }, (_, job) => join(folder, `${job}.gsv`));
    const facts = await Promise.all(files.map((file, job) => codedBy(edge(job), edge(job + 1), file)));
    const bytes = joined(files.map((file) => readFileSync(file)));
    if (values.out) writeFileSync(resolve(process.env.INIT_CWD ?? process.cwd(), values.out), bytes);
    printTable(bytes, facts, (performance.now() - begin) / 1000);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

function codedBy(from: number, until: number, file: string): Promise<Facts> {
  const { cpu, ...texts } = { ...values, jobs: '1', from: String(from), until: String(until), out: file };
  const own = Object.entries(texts).flatMap(([name, value]) => [`--${name}`, value]);
  const child = fork(fileURLToPath(import.meta.url), cpu ? [...own, '--cpu'] : own);
  return new Promise((done, fail) => {
    child.on('message', (facts: Facts) => done(facts));
    child.on('error', fail);
    child.on('exit', (code) => code && fail(new Error(`frames ${from} to ${until - 1}: failed with status ${code}`)));
  });
}

/** Groups of several clips one behind the other. */
function joined(files: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const clips = files.map((file) => ({ file, index: parseClip(file, 'a clip') }));
  const groups = clips.flatMap(({ index }) => index.groups);
  const bodies = clips.map(({ file }) => file.subarray(CLIP_HEAD_BYTES + clipIndexBytes(file, 'a clip')));
  return new Uint8Array(Buffer.concat([writeClipHead({ ...clips[0].index, groups }), ...bodies]));
}

function printTable(bytes: Uint8Array, facts: readonly Facts[], seconds: number): void {
  const index = parseClip(bytes, 'a clip');
  const sum = (of: (facts: Facts) => number): number => facts.reduce((total, own) => total + of(own), 0);
  const minimum = (of: (facts: Facts) => number): string => Math.min(...facts.map(of)).toFixed(2);
  const rate = (length: number): string => `${((8e-6 * length) / index.durationSeconds).toFixed(2)} Mbit/s`;
  const lengths = (of: 'sceneBytes' | 'motionBytes'): number =>
    index.groups.reduce((total, { parts }) => total + parts.reduce((own, part) => own + part[of], 0), 0);
  const head = CLIP_HEAD_BYTES + clipIndexBytes(bytes, 'a clip');
  const { sceneBytes, motionBytes, splats: coarse } = index.groups[0].parts[0];
  const first = head + sceneBytes + motionBytes;
  const at = (megabits: number): string => `${secondsAt(megabits, first).toFixed(2)} s`;
  const rows = [
    ['measure', 'aim', 'seen'],
    ['splats at any time, frames, groups', '', `${splats}, ${frames}, ${index.groups.length} of ${framesPerGroup}`],
    ['splats of all groups, of some frames only', '', `${sum((own) => own.splats)}, ${sum((own) => own.passing)}`],
    ['worst frame, in held-out views', `${values['min-psnr']} dB`, `${minimum((own) => own.worstPsnr)} dB`],
    ['worst view', '', `${minimum((own) => own.worstViewPsnr)} dB`],
    ['rate', '8 Mbit/s', rate(bytes.length)],
    ['  of scenes, of motion', '', `${rate(lengths('sceneBytes'))}, ${rate(lengths('motionBytes'))}`],
    ['first frame at 2 Mbit/s', '1.7 s', at(2)],
    ['  bytes: index, scene, motion', '', `${head}, ${sceneBytes}, ${motionBytes} (${coarse} splats)`],
    ['first frame at 8 Mbit/s', '', at(8)],
    ['waits at 8 Mbit/s, in all', '0 s', `${waitsAt(8, index).toFixed(2)} s`],
    ['bytes', '', String(bytes.length)],
    [
      'processes, CPU, time',
      '',
      `${facts.length}, ${sum((own) => own.cpuSeconds).toFixed(0)} s, ${seconds.toFixed(0)} s`,
    ],
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
