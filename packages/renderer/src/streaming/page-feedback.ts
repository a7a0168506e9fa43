import type { Camera, Vector3 } from '@gaussian-splat/core';
import type { FeedbackInputs, PageRequests, FeedbackSettings } from '../gaussian-scene.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { cameraValues } from '../view.js';
import { CameraMotion } from './camera-motion.js';
import { MAX_VIEWS, FeedbackViews } from './feedback-views.js';
import { constants } from '../generated/shaders.js';
import { pageFeedback } from '../generated/streamed-shaders.js';
import { Stage } from '../stages/stage.js';

/**
 * Frames between two feedback passes: of a resting camera, and of a moving one. Both odd, so that two views that are
 * drawn alternately both get passes.
 */
const INTERVAL = 5;
const MOVING_INTERVAL = 3;
/**
 * Milliseconds after which views without a feedback pass are drawn again to get one; until then views with one are
 * skipped in their favor.
 */
const STALE_MS = 120;

/** Numbers of `ahead` in shaders/page_feedback.wgsl: four columns and the eye. */
const AHEAD_NUMBERS = 20;

export interface PageFeedbackOptions {
  readonly pages: number;
  /** World position of the origin of all positions. */
  readonly origin: Vector3;
  /** Prediction time of a moving camera in milliseconds: the arrival time of a page. */
  readonly aheadMs: () => number;
  /** Changes when pages arrive or are evicted. */
  readonly version: () => number;
  /**
   * Called with the screen errors in pixels of all missing pages, for the view or the predicted one; and with the
   * largest error of the view.
   */
  readonly onFeedback: (requests: Float32Array, lacking: number) => void;
  /** Called when the last view lacks a feedback pass and needs another frame. */
  readonly onStale: () => void;
}

/** Reads the page requests of views back from the GPU at intervals, asynchronously. */
export class PageFeedback implements PageRequests {
  readonly #stage: Stage<typeof pageFeedback>;
  /**
   * For each page the screen error of its absence, float32 bits; at 0, the page that is always resident, the largest
   * error of the view. Cleared before each pass.
   */
  readonly #requests: GPUBuffer;
  readonly #staging: GPUBuffer;
  readonly #ahead: GPUBuffer;
  readonly #device: GPUDevice;
  readonly #options: PageFeedbackOptions;
  readonly #motion = new CameraMotion();
  readonly #views = new FeedbackViews();
  /** Recently drawn views without a feedback pass. */
  readonly #unseen = new Set<string>();
  #givesWayUntil = -Infinity;
  #frames = INTERVAL;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isReading = false;

  constructor(device: GPUDevice, memory: GpuMemory, options: PageFeedbackOptions) {
    this.#device = device;
    this.#options = options;
    this.#stage = new Stage(device, pageFeedback, constants.CULL_GROUP * constants.FEEDBACK_THREADS);
    const { storage, uniform, copySource, copyDestination, mapRead } = BUFFER_USAGE;
    const bytes = 4 * options.pages;
    this.#requests = memory.buffer('gs.requests', bytes, storage | copySource | copyDestination);
    this.#staging = memory.buffer('gs.requests.staging', bytes, mapRead | copyDestination);
    this.#ahead = memory.buffer('gs.requests.ahead', 4 * AHEAD_NUMBERS, uniform | copyDestination);
  }

  /**
   * Whether this frame must record requests; then {@link begin}, {@link note}, {@link copy} and, after the submit,
   * {@link read} follow.
   */
  isDue(camera: Camera, settings: FeedbackSettings): boolean {
    const now = performance.now();
    this.#motion.observe(camera, now);
    const { isMoving } = this.#motion;
    const [view, version] = [nameOf(camera, settings), this.#options.version()];
    const isSeen = this.#views.draw(view, version);
    const isEarly = this.#frames < (isMoving ? MOVING_INTERVAL : INTERVAL) || this.#isReading;
    const isDue = !isEarly && !(isSeen && now < this.#givesWayUntil);
    this.#frames = isDue ? 1 : this.#frames + 1;
    if (isDue) this.#views.begin(view, version, !isMoving);
    this.#wait(view, isDue || isSeen);
    return isDue;
  }

  destroy(): void {
    clearTimeout(this.#timer);
  }

  /** Ensures that every view gets a feedback pass, even if no other frame is drawn. */
  #wait(view: string, isSeen: boolean): void {
    this.#unseen.delete(view);
    if (!isSeen) this.#unseen.add(view);
    const [oldest] = this.#unseen;
    if (this.#unseen.size > MAX_VIEWS) this.#unseen.delete(oldest);
    clearTimeout(this.#timer);
    if (this.#unseen.size > 0) this.#timer = setTimeout(() => this.#sample(), STALE_MS);
  }

  #sample(): void {
    this.#frames = INTERVAL;
    this.#unseen.clear();
    this.#givesWayUntil = performance.now() + STALE_MS;
    this.#options.onStale();
  }

  begin(encoder: GPUCommandEncoder): void {
    encoder.clearBuffer(this.#requests);
    const { origin, aheadMs } = this.#options;
    const { local_to_camera, eye } = cameraValues(this.#motion.ahead(aheadMs()), origin);
    const numbers = new Float32Array(AHEAD_NUMBERS);
    numbers.set(local_to_camera as ArrayLike<number>);
    numbers.set(eye as ArrayLike<number>, AHEAD_NUMBERS - 4);
    this.#device.queue.writeBuffer(this.#ahead, 0, numbers);
  }

  bind(page: FeedbackInputs): GPUBindGroup {
    // The image size or the set of scenes has changed.
    this.#views.clear();
    return this.#stage.bind({ ...page, ahead: this.#ahead, requests: this.#requests });
  }

  note(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#stage.record(pass, bindings, splatCount);
  }

  copy(encoder: GPUCommandEncoder): void {
    encoder.copyBufferToBuffer(this.#requests, 0, this.#staging, 0, this.#requests.size);
    this.#isReading = true;
  }

  read(): void {
    this.#staging.mapAsync(0x1).then(
      () => {
        const requests = this.#views.end(new Float32Array(this.#staging.getMappedRange().slice(0)));
        this.#staging.unmap();
        this.#isReading = false;
        this.#options.onFeedback(requests, requests[0]);
      },
      // The device is lost, or the scene was destroyed meanwhile.
      () => undefined,
    );
  }
}

/** Identifies all parameters of a feedback pass, except the content of the scene. */
function nameOf(camera: Camera, { detail, detailFade, splatBudget }: FeedbackSettings): string {
  const { width, height, fx, fy, cx, cy, near, far, worldToCamera } = camera;
  return [...worldToCamera, width, height, fx, fy, cx, cy, near, far, detail, detailFade, splatBudget].join(' ');
}
