import { eyeOf, inverse, multiply, type Camera } from '@gaussian-splat/core';
import type { FeedbackInputs, PageRequests, FeedbackSettings } from '../gaussian-scene.js';
import { BUFFER_USAGE } from '../gpu/kernel.js';
import type { GpuMemory } from '../gpu/memory.js';
import { CameraMotion } from './camera-motion.js';
import { MAX_VIEWS, FeedbackViews } from './feedback-views.js';
import { constants } from '../generated/shaders.js';
import { pageFeedback } from '../generated/streamed-shaders.js';
import { Stage } from '../stages/stage.js';

/**
 * Frames between two feedback passes of a resting camera. Odd, so that two views that are drawn alternately both get
 * passes.
 */
const INTERVAL = 5;
/** Frames between two feedback passes of a moving camera. */
const MOVING_INTERVAL = 3;
/**
 * Milliseconds without a frame after which views without a feedback pass are drawn again to get one. For the same time
 * afterwards, views that have one are skipped in their favor.
 */
const STALE_MS = 120;

/** Number of float32 in `ahead` of shaders/page_feedback.wgsl: four columns of a matrix, and a position. */
const AHEAD_NUMBERS = 20;

export interface PageFeedbackOptions {
  /** Maximum number of pages of the scene. */
  readonly pages: number;
  /** Returns the current number of pages. */
  readonly count: () => number;
  /** Prediction time of a moving camera in milliseconds: the arrival time of a page. */
  readonly aheadMs: () => number;
  /** Returns the version of the scene, which changes when pages arrive or are evicted. */
  readonly version: () => number;
  /**
   * Called after each read-back with the screen errors in pixels of all missing pages, each the larger of the view and
   * the predicted view. The second argument is the largest error of the view in pixels, the third the error threshold
   * that its splat budget requires, or 0.
   */
  readonly onFeedback: (requests: Float32Array, lacking: number, budgetError: number) => void;
  /** Called when the last view lacks a feedback pass and needs another frame. */
  readonly onStale: () => void;
}

/** Reads the page requests of views back from the GPU at intervals. No frame waits for them. */
export class PageFeedback implements PageRequests {
  readonly #stage: Stage<typeof pageFeedback>;
  /**
   * [P] float32 bits of the screen error in pixels that each page, resident or not, causes if it is missing; 0 if no view
   * needs the page. Element 0, the page that is always resident, has the largest error of the view. Cleared before each
   * pass.
   */
  readonly #requests: GPUBuffer;
  /** [P + 1] copy of the requests, followed by the error threshold. */
  readonly #staging: GPUBuffer;
  /** Its last word is the error threshold of the splat budget. */
  #shares: GPUBuffer | undefined;
  readonly #ahead: GPUBuffer;
  readonly #device: GPUDevice;
  readonly #options: PageFeedbackOptions;
  readonly #motion = new CameraMotion();
  readonly #views = new FeedbackViews();
  /** Recently drawn views without a feedback pass. */
  readonly #unseen = new Set<string>();
  /** Time in milliseconds until which views with a feedback pass are skipped in favor of others. */
  #givesWayUntil = -Infinity;
  #frames = INTERVAL;
  /** Views that were drawn since the last {@link #sample}, up to one more than are tracked. */
  readonly #drawn = new Set<string>();
  /** Number of samples with several drawn views, and of draws after the last one that get no feedback pass. */
  #samples = 0;
  #passedOver = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #isReading = false;
  /** Number of bytes of the requests in the read-back. */
  #bytes = 0;
  /** Matrix of the last camera. */
  #worldToCamera: Camera['worldToCamera'] = [];

  constructor(device: GPUDevice, memory: GpuMemory, options: PageFeedbackOptions) {
    this.#device = device;
    this.#options = options;
    this.#stage = new Stage(device, pageFeedback, constants.CULL_GROUP * constants.FEEDBACK_THREADS);
    const { storage, uniform, copySource, copyDestination, mapRead } = BUFFER_USAGE;
    const bytes = 4 * options.pages;
    this.#requests = memory.buffer('gs.requests', bytes, storage | copySource | copyDestination);
    this.#staging = memory.buffer('gs.requests.staging', bytes + 4, mapRead | copyDestination);
    this.#ahead = memory.buffer('gs.requests.ahead', 4 * AHEAD_NUMBERS, uniform | copyDestination);
  }

  /**
   * Whether this frame must record requests. If so, call {@link begin}, {@link note}, {@link copy} and, after the
   * submit, {@link read}.
   */
  isDue(camera: Camera, settings: FeedbackSettings, changes: number): boolean {
    const now = performance.now();
    this.#motion.observe(camera, now);
    this.#worldToCamera = camera.worldToCamera;
    const { isMoving } = this.#motion;
    const [view, version] = [`${nameOf(camera, settings)} ${changes}`, this.#options.version()];
    const isSeen = this.#views.draw(view, version);
    if (this.#drawn.size <= MAX_VIEWS) this.#drawn.add(view);
    const isPassedOver = this.#passedOver > 0;
    if (isPassedOver) this.#passedOver--;
    const isEarly = this.#frames < (isMoving ? MOVING_INTERVAL : INTERVAL) || this.#isReading || isPassedOver;
    const isDue = !isEarly && !(isSeen && now < this.#givesWayUntil);
    this.#frames = isDue ? 1 : this.#frames + 1;
    if (isDue) this.#views.begin(view, version, !isMoving);
    this.#wait(view, isDue || isSeen);
    return isDue;
  }

  destroy(): void {
    clearTimeout(this.#timer);
  }

  /** Schedules a sample if a view has no feedback pass, for the case that no other frame is drawn. */
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
    // Views that are drawn in turns get passes in turns, even if every frame is later than this timer.
    const views = this.#drawn.size;
    this.#passedOver = views > 1 && views <= MAX_VIEWS ? this.#samples++ % views : 0;
    this.#drawn.clear();
    this.#unseen.clear();
    this.#givesWayUntil = performance.now() + STALE_MS;
    this.#options.onStale();
  }

  begin(encoder: GPUCommandEncoder): void {
    encoder.clearBuffer(this.#requests);
    const { worldToCamera } = this.#motion.ahead(this.#options.aheadMs());
    // Relative to the camera, because each placement of the scene has its own transform to camera coordinates.
    const toAhead = multiply(worldToCamera, inverse(this.#worldToCamera));
    const numbers = new Float32Array(AHEAD_NUMBERS);
    for (let k = 0; k < 16; k++) numbers[k] = toAhead[4 * (k % 4) + (k >> 2)];
    numbers.set(eyeOf(toAhead), AHEAD_NUMBERS - 4);
    this.#device.queue.writeBuffer(this.#ahead, 0, numbers);
  }

  bind(page: FeedbackInputs): GPUBindGroup {
    // New bindings mean another image size or another set of scenes, so all passes are invalid.
    this.#views.clear();
    this.#shares = page.chunk_shares;
    return this.#stage.bind({ ...page, ahead: this.#ahead, requests: this.#requests });
  }

  note(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void {
    this.#stage.record(pass, bindings, splatCount);
  }

  copy(encoder: GPUCommandEncoder): void {
    this.#bytes = 4 * this.#options.count();
    encoder.copyBufferToBuffer(this.#requests, 0, this.#staging, 0, this.#bytes);
    const shares = this.#shares!;
    encoder.copyBufferToBuffer(shares, shares.size - 4, this.#staging, this.#bytes, 4);
    this.#isReading = true;
  }

  read(): void {
    const bytes = this.#bytes;
    this.#staging.mapAsync(0x1, 0, bytes + 4).then(
      () => {
        const read = new Float32Array(this.#staging.getMappedRange(0, bytes + 4).slice(0));
        const requests = this.#views.end(read.subarray(0, bytes / 4));
        this.#staging.unmap();
        this.#isReading = false;
        this.#options.onFeedback(requests, requests[0], read[bytes / 4]);
      },
      // Fails if the device is lost or the scene was destroyed meanwhile.
      () => undefined,
    );
  }
}

/** Returns a name of a view that contains all parameters of its feedback pass, except the world and the scene. */
function nameOf(camera: Camera, { detail, detailFade, splatBudget }: FeedbackSettings): string {
  const { width, height, fx, fy, cx, cy, near, far, worldToCamera } = camera;
  return [...worldToCamera, width, height, fx, fy, cx, cy, near, far, detail, detailFade, splatBudget].join(' ');
}
