/** Clips whose every frame is known. Each has one kind of change that an encoder may get wrong. */
import { readFileSync } from 'node:fs';
import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { readScene, turned } from '@gaussian-splat/formats';
import { cloudOf, type SplatDescription } from '../clouds.js';
import { seededRandom } from '../random.js';
import { fountain } from './fountain.js';

export interface MadeClip {
  readonly splats: number;
  readonly frames: number;
}

/** Returns a frame by its index. */
export type FrameOf = (frame: number) => GaussianCloud;

/** Makes each frame once, because an encoder opens it for every attempt. */
export function remembered(frameOf: FrameOf): FrameOf {
  const made = new Map<number, GaussianCloud>();
  return (frame) => {
    const cloud = made.get(frame) ?? frameOf(frame);
    made.set(frame, cloud);
    return cloud;
  };
}

/** Properties that splat `i` has in a frame; `time` is 0 to 1 in the clip. Undefined: it does not exist. */
type Change = (splat: SplatDescription, time: number, i: number) => Partial<SplatDescription> | undefined;

/** Splats on a sphere of radius 1, equally dense for any number of them. */
function sphere(splats: number): SplatDescription[] {
  const random = seededRandom(9);
  const size = 1.2 / Math.sqrt(splats);
  return Array.from({ length: splats }, () => ({
    position: random.direction(),
    scale: [size * random.uniform(1, 2), size * random.uniform(1, 2), size * random.uniform(0.5, 1)] as const,
    rotation: random.rotation(),
    opacity: random.uniform(0.5, 0.95),
    color: [random.uniform(0, 1), random.uniform(0, 1), 0.4] as const,
    sh: [0.15, -0.15, 0.15, -0.15, 0.15, -0.15, 0.15, 0.15, 0.15],
  }));
}

const changing =
  (change: Change) =>
  ({ splats, frames }: MadeClip): FrameOf => {
    const all = sphere(splats);
    const at = (frame: number) => (splat: SplatDescription, i: number) => {
      const changes = change(splat, frame / frames, i);
      return changes ? [{ ...splat, ...changes }] : [];
    };
    return (frame) => cloudOf(all.flatMap(at(frame)));
  };

/** The cloud on a turntable: a rigid body, whose harmonics turn with it. */
const turning =
  (cloud: GaussianCloud, angle: number): FrameOf =>
  (frame) => {
    const [c, s] = [Math.cos(angle * frame), Math.sin(angle * frame)];
    return turned(cloud, [c, 0, s, 0, 1, 0, -s, 0, c]);
  };

const waved = (place: Vector3, size: number, angle: number): Vector3 =>
  place.map((value, k) => value + size * Math.sin(angle + 3 * place[(k + 1) % 3])) as unknown as Vector3;
const scaled = (v: Vector3, factor: number): Vector3 => v.map((value) => factor * value) as unknown as Vector3;
const drift = (place: Vector3, time: number): Vector3 => waved(place, 0.05, 1.2 * time);
const isIn = (time: number, from: number, to: number): boolean => time >= from && time < to;
const DEGREE = Math.PI / 180;

/** Clips by name; the first ten change in one way each. */
export const MADE_CLIPS: Record<string, (clip: MadeClip) => FrameOf | Promise<FrameOf>> = {
  drift: changing(({ position }, time) => ({ position: drift(position, time) })),
  flash: changing(({ position, color }, time, i) => ({
    position: drift(position, time),
    color: i % 20 === 0 && isIn(time, 0.4, 0.55) ? [1, 1, 1] : color,
  })),
  burst: changing(({ position }, time, i) => {
    if (i % 10 > 0) return { position: drift(position, time) };
    return isIn(time, 0.3, 0.75) ? { position: scaled(position, 0.9 + 0.4 * time), color: [1, 0.8, 0.1] } : undefined;
  }),
  spin: ({ splats }) => turning(cloudOf(sphere(splats)), 8 * DEGREE),
  fade: changing(({ opacity }, time, i) => ({ opacity: opacity * (i % 3 ? 1 : Math.max(0.05, 1 - time)) })),
  breathe: changing(({ scale }, time) => ({ scale: scaled(scale as Vector3, 1 + 0.3 * Math.sin(6 * time)) })),
  hue: changing(({ position, color }, time) => ({
    color: [0.5 + 0.4 * Math.sin(5 * time + position[0]), color[1], 0.4],
  })),
  jump: changing(({ position: [x, y, z] }, time, i) => ({
    position: [x, y + (i % 5 === 0 && time > 0.6 ? 0.3 : 0), z],
  })),
  fast: changing(({ position }, time) => ({ position: waved(position, 0.15, 6 * time) })),
  cross: changing(({ position: [x, y, z] }, time, i) => ({
    position: [x + (i % 2 ? 0.6 : -0.6) * (time - 0.5), y, z],
  })),
  /** Degree 1, by 4 degrees a frame. */
  ball: ({ splats }) => turning(cloudOf(sphere(splats), 1), 4 * DEGREE),
  /** A capture of degree 2, by 4 degrees a frame. */
  skull: async () => turning(await capture('skull.spz'), 4 * DEGREE),
  /** 95 % never change. */
  room: ({ splats, frames }) => {
    const all = sphere(splats).map((splat) => ({ ...splat, position: scaled(splat.position, 3) }));
    const mover = (splat: SplatDescription, i: number, time: number): SplatDescription =>
      i % 20 ? splat : { ...splat, position: waved(scaled(splat.position, 0.2), 0.1, 12 * time) };
    return (frame) => cloudOf(all.map((splat, i) => mover(splat, i, frame / frames)));
  },
  /** Births and deaths: 30 frames a second. */
  fountain: ({ splats, frames }) => fountain({ splats, frames, framesPerSecond: 30 }),
};

async function capture(name: string): Promise<GaussianCloud> {
  const bytes = readFileSync(new URL(`../../../demo/scenes/${name}`, import.meta.url));
  return readScene(bytes, { name });
}
