/**
 * `npm run lab:clip -- [--splats N] [--frames N] [--per-file N] [--min-db DB] [--out FILE]`: what a clip costs whose splats come and go: a made, seeded fountain of 150,000
 * splats at 30 frames a second. Says the rate, the bytes before the first frame, and how long each of them takes at 2 and 8 Mbit/s.
 */
import { writeFileSync } from 'node:fs';
import { resolve } from 'node:path';
import { parseArgs } from 'node:util';
import { codeClip } from '@gaussian-splat/economise';
import { CLIP_HEAD_BYTES, clipIndexBytes, parseClip, type ClipIndex } from '@gaussian-splat/formats';
import { deviceDescriptor, startVariants } from '@gaussian-splat/renderer';
import { deflate, deflateQuickly, encodeWebp } from '../../packages/cli/src/lib/encoders.mjs';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { fountain } from './scenes/fountain.js';

const FRAMES_PER_SECOND = 30;
const text = (fallback: string) => ({ type: 'string', default: fallback }) as const;
const { values } = parseArgs({
  options: {
    ...{ splats: text('150000'), frames: text('300'), 'per-file': text('90'), 'min-db': text('45') },
    out: { type: 'string' },
  },
});
const [splats, frames, framesPerGroup] = [values.splats, values.frames, values['per-file']].map(Number);

const adapter = await requestNodeAdapter({ isTrusted: true });
const device = await adapter.requestDevice(deviceDescriptor(adapter));
await startVariants(device, { format: 'rgba8unorm' });
const frameOf = fountain({ splats, frames, framesPerSecond: FRAMES_PER_SECOND });
const begin = performance.now();
const { user } = process.cpuUsage();
const seconds = (since: number): string => ((performance.now() - since) / 1000).toFixed(0);
const clip = await codeClip({
  ...{ frameCount: frames, framesPerSecond: FRAMES_PER_SECOND, framesPerGroup, minDecibels: Number(values['min-db']) },
  openFrame: (frame) => Promise.resolve(frameOf(frame)),
  ...{ device, encodeWebp, deflate, deflateQuickly },
  onStep: (step) => console.log(`${seconds(begin)} s: ${step}`),
});
const cpu = (process.cpuUsage().user - user) / 1e6;
if (values.out) writeFileSync(resolve(process.env.INIT_CWD ?? process.cwd(), values.out), clip.bytes);

const index = parseClip(clip.bytes, 'a clip');
const rate = (8e-6 * clip.bytes.length) / index.durationSeconds;
console.log(
  `${splats} splats at any time, ${frames} frames in groups of ${framesPerGroup}: ${cpu.toFixed(0)} s of CPU`,
);
console.log(`${clip.splats} splats in all groups, ${clip.passing} of them in some frames only`);
console.log(`${clip.decibels.toFixed(2)} dB in held-out views, ${clip.worstDecibels.toFixed(2)} dB in the worst`);
console.log(
  `${clip.bytes.length} bytes: ${rate.toFixed(2)} Mbit/s; scenes ${share('sceneBytes')}, motion ${share('motionBytes')}`,
);
const first = CLIP_HEAD_BYTES + clipIndexBytes(clip.bytes, 'a clip');
const { sceneBytes, motionBytes } = index.groups[0].parts[0];
console.log(
  `the first frame needs ${clip.firstBytes} bytes (index ${first}, scene ${sceneBytes}, motion ${motionBytes}): ` +
    `${secondsAt(2, clip.firstBytes).toFixed(2)} s at 2 Mbit/s, ${secondsAt(8, clip.firstBytes).toFixed(2)} s at 8`,
);
console.log(`at 8 Mbit/s, played from the first frame on, it waits ${waitsAt(8, index).toFixed(2)} s in all`);
device.destroy();

function share(of: 'sceneBytes' | 'motionBytes'): string {
  const bytes = index.groups.reduce((sum, { parts }) => sum + parts.reduce((own, part) => own + part[of], 0), 0);
  return `${((8e-6 * bytes) / index.durationSeconds).toFixed(2)} Mbit/s`;
}

function secondsAt(megabits: number, bytes: number): number {
  return (8e-6 * bytes) / megabits;
}

/** Seconds in which a clip stands still, because the coarse part of a group has not come when it is due. */
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
