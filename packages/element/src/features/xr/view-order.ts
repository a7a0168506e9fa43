import { cross, dot, eyeOf, normalize, type Camera, type Vector3 } from '@gaussian-splat/core';
import {
  DATA_WIDTH,
  distanceView,
  isSameView,
  orderView,
  SplatOrder,
  type OrderView,
} from '@gaussian-splat/renderer/webgl';
import { DepthSorter } from '../../webgl/depth-sorter.js';
import type { XrScene } from './xr-scene.js';

/**
 * Maximum duration of a sort on this thread, milliseconds. Slower sorts are left to a worker, by distance, so that
 * turning the head does not change the order.
 */
const QUICK_SORT_MS = 8;
/** Weight of the last sort in the moving average of durations, 0..1. */
const SMOOTHING = 0.2;
/** Sine of the angle below which the viewing directions of two eyes count as parallel. */
const PARALLEL = 1e-4;
/** Movement of the head, as a fraction of its distance to the center of the scene, after which a worker sorts again. */
const MOVED = 0.002;

/** Sorts the splats of a session, in one order for all views of a frame. */
export class ViewOrder {
  readonly #scene: XrScene;
  readonly #spawn: () => Worker;
  readonly #sorter: SplatOrder;
  readonly #order: Uint32Array;
  #worker: DepthSorter | undefined;
  #sorted: OrderView | undefined;
  /** Average duration of sorts on this thread, milliseconds; 0 before the first. */
  milliseconds = 0;

  constructor(scene: XrScene, spawn: () => Worker) {
    this.#scene = scene;
    this.#spawn = spawn;
    this.#sorter = new SplatOrder(scene.positions);
    this.#order = new Uint32Array(DATA_WIDTH * Math.max(1, Math.ceil(scene.positions.length / 3 / DATA_WIDTH)));
  }

  /**
   * Sorts for the views of a frame if they have moved: immediately, or in the worker.
   * @param byDistance Whether the page requests an order by distance.
   */
  update(cameras: readonly Camera[], byDistance: boolean): void {
    const view = this.#viewOf(cameras, byDistance);
    if (this.#sorted && isSameView(view, this.#sorted)) return;
    if (this.#sorted === undefined || this.milliseconds <= QUICK_SORT_MS) this.#sortNow(view);
    else this.#sortSoon(view);
  }

  destroy(): void {
    this.#worker?.destroy();
  }

  /**
   * Returns an order by depth if the views are parallel and sorts are fast: it is exact for all eyes. Otherwise returns
   * an order by distance from the center of the eyes.
   */
  #viewOf(cameras: readonly Camera[], byDistance: boolean): OrderView {
    const [first] = cameras;
    const { origin } = this.#scene;
    const isDepth = !byDistance && this.milliseconds <= QUICK_SORT_MS && areParallel(cameras);
    if (isDepth) return orderView(first, origin);
    const eyes = cameras.map(({ worldToCamera }) => eyeOf(worldToCamera));
    const middle = [0, 1, 2].map((k) => eyes.reduce((sum, eye) => sum + eye[k], 0) / eyes.length);
    return distanceView(first, origin, middle as unknown as Vector3);
  }

  #sortNow(view: OrderView): void {
    // Sorts once before the measurement, because the first sort includes compilation.
    if (this.#sorted === undefined) this.#sorter.sort(view, this.#order);
    const begin = performance.now();
    const count = this.#sorter.sort(view, this.#order);
    const took = performance.now() - begin;
    // A single sort that was interrupted for long does not count as slow: slower sorts are not measured again.
    const excess = Math.min(took, 2 * QUICK_SORT_MS) - this.milliseconds;
    this.milliseconds = this.#sorted === undefined ? took : this.milliseconds + SMOOTHING * excess;
    this.#set(view, this.#order, count);
  }

  #sortSoon(view: OrderView): void {
    const before = this.#sorted?.point;
    if (before && view.point && distance(before, view.point) < MOVED * distance(view.point, [0, 0, 0])) return;
    this.#worker ??= new DepthSorter({
      ...{ positions: this.#scene.positions, spawn: this.#spawn },
      onOrder: (sorted) => this.#set(sorted.view, sorted.order, sorted.count),
    });
    this.#worker.request(view);
  }

  #set(view: OrderView, order: Uint32Array, count: number): void {
    this.#scene.renderer.setOrder(order, count);
    this.#sorted = view;
  }
}

const axisOf = ({ worldToCamera: m }: Camera): Vector3 => normalize([m[8], m[9], m[10]]);
const distance = (a: Vector3, b: Vector3): number => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

function areParallel([first, ...others]: readonly Camera[]): boolean {
  const axis = axisOf(first);
  return others.every((camera) => length(cross(axis, axisOf(camera))) < PARALLEL && dot(axis, axisOf(camera)) > 0);
}

const length = (v: Vector3): number => Math.hypot(...v);
