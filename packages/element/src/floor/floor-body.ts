import type { Vector3 } from '@gaussian-splat/core';
import { floorAt, stepOn, wayTo, type FloorMap } from '@gaussian-splat/formats/floor';

/** Walking speed, meters per second. */
const SPEED = 1.4;
const FAST = 2.5;
/** Time constant with which the eyes follow steps of the floor, seconds. */
const EYE_SECONDS = 0.08;
/** Distance to a waypoint, meters, below which it is reached. */
const REACHED = 0.05;
/** Number of directions that are compared for the first view. */
const DIRECTIONS = 32;
/** Distance, meters, beyond which floor is equally far. */
const FAR = 20;
/** Minimum fraction of the longest way of the first view. */
const LONG_ENOUGH = 0.7;

type Place = readonly [x: number, y: number, z: number];

/** A body on a map of the floor: meters in viewer space. Independent of page and camera. */
export class FloorBody {
  readonly map: FloorMap;
  #at: Place;
  /** Height of the floor under the eyes, smoothed over time, meters. */
  #eyeFloor: number;
  #path: readonly Place[] = [];
  /** Index in the path of the next waypoint. */
  #next = 0;
  /** The search for a path. */
  #searching: AbortController | undefined;
  #isBlocked = false;

  constructor(map: FloorMap, near: Vector3) {
    this.map = map;
    this.#at = map.start;
    this.#eyeFloor = this.#at[1];
    this.land(near);
  }

  /** Position of the feet in viewer space, meters. */
  get at(): Place {
    return this.#at;
  }

  /** Height of the floor for the eyes, meters. It follows steps of the floor smoothly. */
  get eyeFloor(): number {
    return this.#eyeFloor;
  }

  /** Whether the last step did not move the body. */
  get isBlocked(): boolean {
    return this.#isBlocked;
  }

  /** Whether the motion needs more steps: the body follows a path, or the eyes have not reached their height. */
  get isMoving(): boolean {
    return this.#next < this.#path.length || this.#eyeFloor !== this.#at[1];
  }

  /** Moves the body at once to the floor below a point. It stays where it is if there is no floor. */
  land(near: Vector3): void {
    const below = floorBelow(this.map, near);
    if (below === undefined) return;
    this.#leave();
    this.#at = [near[0], below, near[2]];
    this.#eyeFloor = below;
  }

  /**
   * Starts to walk to a point on the floor. Another motion ends the search for a path.
   * @returns whether there is a path to it
   */
  async goTo(to: Vector3): Promise<boolean> {
    this.#leave();
    const { signal } = (this.#searching = new AbortController());
    const height = floorAt(this.map, to[0], to[2], to[1]);
    if (height === undefined) return false;
    const path = await wayTo(this.map, this.#at, [to[0], height, to[2]], signal).catch(() => []);
    if (signal.aborted) return false;
    this.#path = path;
    return path.length > 0;
  }

  /** Leaves the path, and ends the search for one. */
  #leave(): void {
    this.#searching?.abort();
    this.#searching = undefined;
    this.#path = [];
    this.#next = 0;
  }

  /** Moves the body to the end of its path at once. */
  jump(): void {
    const end = this.#path.at(-1);
    this.#leave();
    if (end) this.#at = end;
    this.#eyeFloor = this.#at[1];
  }

  /**
   * Moves the body for some seconds in the direction x, z of viewer space. A direction longer than 1 counts as 1; 0, 0
   * follows the path.
   */
  step(seconds: number, x: number, z: number, isFast = false): void {
    const way = SPEED * (isFast ? FAST : 1) * seconds;
    const length = Math.max(1, Math.hypot(x, z));
    if (x !== 0 || z !== 0) {
      this.#leave();
      this.#go((way * x) / length, (way * z) / length);
    } else this.#follow(way);
    const share = 1 - Math.exp(-seconds / EYE_SECONDS);
    const rest = this.#at[1] - this.#eyeFloor;
    this.#eyeFloor = Math.abs(rest) < 1e-3 ? this.#at[1] : this.#eyeFloor + share * rest;
  }

  /**
   * Returns the azimuth of a camera, radians, in whose direction the floor extends far, so that a room is seen along its
   * length: `theta`, its present azimuth, or else the one that is nearest to it, because `theta` faces the scene.
   */
  openDirection(theta: number): number {
    const azimuths = Array.from({ length: DIRECTIONS }, (_, k) => theta + (2 * Math.PI * k) / DIRECTIONS);
    const ways = azimuths.map((azimuth) => this.#wayAlong(azimuth));
    // A gap between two pieces of furniture is narrow, so its neighbors count, too.
    const views = ways.map((way, k) => way + ways.at(k - 1)! + ways[(k + 1) % DIRECTIONS]);
    const longest = Math.max(...views);
    const isLong = (k: number): boolean => views[k] >= LONG_ENOUGH * longest;
    if (isLong(0)) return theta;
    const isPeak = (k: number): boolean => views[k] >= Math.max(views.at(k - 1)!, views[(k + 1) % DIRECTIONS]);
    const turnTo = (k: number): number => Math.min(k, DIRECTIONS - k);
    const open = views.flatMap((_, k) => (isLong(k) && isPeak(k) ? [k] : []));
    return azimuths[open.reduce((best, k) => (turnTo(k) < turnTo(best) ? k : best))];
  }

  /** Returns how far the body could walk straight in the direction of a camera's azimuth, meters, {@link FAR} at most. */
  #wayAlong(azimuth: number): number {
    const step = this.map.cell;
    const [dx, dz] = [-step * Math.sin(azimuth), -step * Math.cos(azimuth)];
    let at = this.#at;
    for (let way = 0; way < FAR; way += step) {
      const to = stepOn(this.map, at, dx, dz);
      // A body that slides along a wall has reached it.
      if (to === at || to[0] !== at[0] + dx || to[2] !== at[2] + dz) return way;
      at = to;
    }
    return FAR;
  }

  #follow(way: number): void {
    for (let left = way; left > 0 && this.#next < this.#path.length;) {
      const next = this.#path[this.#next];
      const [dx, dz] = [next[0] - this.#at[0], next[2] - this.#at[2]];
      const distance = Math.hypot(dx, dz);
      const share = Math.min(1, left / Math.max(distance, 1e-9));
      left -= distance;
      if (distance > 0 && !this.#go(share * dx, share * dz)) return this.#leave();
      if (distance <= Math.max(REACHED, way)) this.#next++;
    }
  }

  #go(dx: number, dz: number): boolean {
    const to = stepOn(this.map, this.#at, dx, dz);
    this.#isBlocked = to === this.#at;
    this.#at = to;
    return !this.#isBlocked;
  }
}

/** Returns the height of the highest floor below a point, meters; undefined if there is none. */
function floorBelow({ corner, cell, width, depth, layers }: FloorMap, [x, y, z]: Vector3): number | undefined {
  const [i, j] = [Math.floor((x - corner[0]) / cell), Math.floor((z - corner[1]) / cell)];
  if (!(i >= 0 && j >= 0 && i < width && j < depth)) return undefined;
  const below = layers.map((layer) => layer[i + width * j]).filter((height) => height <= y);
  return below.length > 0 ? Math.max(...below) : undefined;
}
