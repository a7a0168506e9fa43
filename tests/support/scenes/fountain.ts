/** A scene that changes: a still ground, a body that swings, and drops that rise, fall and are gone. No frame says which of its splats were in the one before. */
import type { GaussianCloud, Vector3 } from '@gaussian-splat/core';
import { splatsOf } from '../../../packages/optimize/src/reduce.js';
import { cloudOf, type SplatDescription } from '../clouds.js';
import { seededRandom } from '../random.js';

export interface Fountain {
  readonly splats: number;
  readonly frames: number;
  readonly framesPerSecond: number;
  readonly seed?: number;
}

interface Drop {
  /** Seconds of its birth and of its life. */
  readonly birth: number;
  readonly life: number;
  readonly velocity: Vector3;
  readonly splat: SplatDescription;
}

/** Fractions of the splats that are static, and that swing; at any time the rest is drops. */
const [GROUND, BODY] = [0.4, 0.45];
const GRAVITY = 2.4;

/** The frames, made one by one. */
export function fountain({ splats, frames, framesPerSecond, seed = 5 }: Fountain): (frame: number) => GaussianCloud {
  const random = seededRandom(seed);
  const sizeOf = (share: number): number => share * Math.sqrt(12 / splats);
  const look = (position: Vector3, size: number, color: Vector3): SplatDescription => ({
    ...{ position, color, opacity: random.uniform(0.5, 1), rotation: random.rotation() },
    scale: [size * random.uniform(0.6, 1.3), size * random.uniform(0.4, 1), size * random.uniform(0.1, 0.4)],
  });
  const ground = Array.from({ length: Math.round(GROUND * splats) }, () => {
    const [angle, radius] = [random.uniform(0, 2 * Math.PI), 2 * Math.sqrt(random.uniform(0, 1))];
    const place: Vector3 = [radius * Math.cos(angle), 0.02 * Math.sin(5 * angle), radius * Math.sin(angle)];
    const shade = 0.35 + 0.1 * Math.sin(4 * place[0]) * Math.cos(3 * place[2]);
    return look(place, sizeOf(1.2), [shade, shade + 0.08, shade - 0.05]);
  });
  const body = Array.from({ length: Math.round(BODY * splats) }, () => {
    const [x, y, z] = random.direction();
    const place: Vector3 = [0.45 * x, -0.9 + 0.8 * y, 0.45 * z];
    const wave = 0.12 * Math.sin(6 * y + 2 * x);
    return look(place, sizeOf(0.9), [0.6 + wave, 0.4 - wave, 0.35 + wave]);
  });
  const seconds = frames / framesPerSecond;
  const living = splats - ground.length - body.length;
  const life = 1.3;
  const drops = Array.from({ length: Math.round((living * (seconds + life)) / life) }, (): Drop => {
    const angle = random.uniform(0, 2 * Math.PI);
    const speed = random.uniform(0.3, 0.9);
    const splat = look([0.5 * Math.cos(angle), -1.6, 0.5 * Math.sin(angle)], sizeOf(0.9), [0.5, 0.65, 0.9]);
    const velocity: Vector3 = [speed * Math.cos(angle), -random.uniform(0.6, 1.4), speed * Math.sin(angle)];
    return { birth: random.uniform(-life, seconds), life: random.uniform(0.8, 1.2) * life, velocity, splat };
  });
  const shuffle = seededRandom(seed + 1);
  const whole = cloudOf([...ground, ...body, ...drops.map(({ splat }) => splat)]);
  const still = ground.length;
  const lasting = still + body.length;
  return (frame) => {
    const time = frame / framesPerSecond;
    const isShown = (i: number): boolean => i < lasting || isAlive(drops[i - lasting], time);
    const order = Uint32Array.from(Array.from({ length: whole.count }, (_, i) => i).filter(isShown));
    for (let i = order.length - 1; i > 0; i--) {
      const k = Math.floor(shuffle.uniform(0, i + 1));
      [order[i], order[k]] = [order[k], order[i]];
    }
    // Only positions and opacities change: long clips are made in seconds.
    const cloud = splatsOf(whole, order);
    order.forEach((i, place) => {
      if (i < still) return;
      const { position, opacity } = i < lasting ? swung(body[i - still], time) : fallen(drops[i - lasting], time);
      for (let axis = 0; axis < 3; axis++) cloud.positions[3 * place + axis] = position[axis];
      cloud.opacities[place] = opacity;
    });
    return cloud;
  };
}

type Shown = Pick<SplatDescription, 'position' | 'opacity'>;

function swung({ position: [x, y, z], opacity }: SplatDescription, time: number): Shown {
  const bend = 0.35 * Math.sin(2 * time) * -y;
  return { position: [x + bend * 0.6, y, z + 0.15 * Math.cos(3 * time) * y], opacity };
}

const isAlive = ({ birth, life }: Drop, time: number): boolean => time >= birth && time - birth < life;

function fallen({ birth, life, velocity, splat }: Drop, time: number): Shown {
  const age = time - birth;
  const [x, y, z] = splat.position.map((value, k) => value + velocity[k] * age);
  const fade = Math.min(1, 8 * (age / life), 8 * (1 - age / life));
  return { position: [x, y + 0.5 * GRAVITY * age * age, z], opacity: splat.opacity * fade };
}
