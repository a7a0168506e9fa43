import type { Camera } from '@gaussian-splat/core';
import type { FrameBindings, Stages } from './bindings.js';
import type { PageRequests, FeedbackSettings } from './gaussian-scene.js';
import type { FrameTimer } from './gpu/pass-timer.js';
import type { RenderSettings } from './render-settings.js';
import type { PixelOrder } from './rasterizers/pixel-order.js';
import type { Scratch } from './scratch.js';

/** Inputs of the stages before the rasterizer, bound and allocated in advance. */
export interface Frame {
  readonly stages: Stages;
  readonly bindings: FrameBindings;
  readonly scratch: Scratch;
  readonly camera: Camera;
  readonly settings: FeedbackSettings & Pick<RenderSettings, 'depthKeyBits'>;
  /** Whether to list the indices of the visible splats by slot in {@link Scratch.survivors}, for auxiliary outputs. */
  readonly keepsSurvivors: boolean;
  /** Whether a block has levels of detail. */
  readonly hasDetail: boolean;
  /** Whether to limit the splats to `RenderSettings.splatBudget`. */
  readonly isBudgeted: boolean;
  /** Sorts splats for each pixel. */
  readonly order: PixelOrder | undefined;
  /** Whether the rasterizer needs the depths of the splats, so that keys must be depths. */
  readonly keepsDepths: boolean;
  readonly timer?: FrameTimer | undefined;
}

/**
 * Records the projection of Gaussians to splats, sorted from near to far: cull, project, sort. Counts stay in `plan` on
 * the GPU; the CPU reads nothing.
 * @returns Page requests of streamed scenes, to be copied at the end of the frame and read after the submit.
 */
export function recordProjection(encoder: GPUCommandEncoder, frame: Frame): PageRequests[] {
  const { scratch, bindings, timer } = frame;
  const requests = feedbackDue(frame);
  for (const request of requests) request.begin(encoder);
  encoder.clearBuffer(scratch.cullStats);
  if (frame.isBudgeted) encoder.clearBuffer(scratch.detailCounts);
  // Clears the threshold of an earlier budget.
  else if (frame.hasDetail) encoder.clearBuffer(scratch.chunkShares, scratch.chunkShares.size - 4);
  const pass = encoder.beginComputePass({ label: 'gs.project', timestampWrites: timer?.timestampWrites('project') });
  if (frame.isBudgeted) keepWithinBudget(pass, bindings);
  cull(pass, frame);
  listSurvivors(pass, frame);
  for (const { reading, project, splatCount } of bindings.pages) {
    reading.project.record(pass, project, Math.min(scratch.capacity, splatCount));
  }
  frame.order?.recordDepths(pass, bindings);
  recordFeedback(pass, frame, requests);
  pass.end();
  if (frame.keepsSurvivors) scratch.keepSurvivors(encoder);
  if (frame.keepsDepths) scratch.keepDepths(encoder);
  sort(encoder, frame);
  return requests;
}

/** Finds the error threshold on screen that keeps the frame within its splat budget. */
function keepWithinBudget(pass: GPUComputePassEncoder, { pages, budget }: FrameBindings): void {
  if (!budget) return;
  pages.forEach(({ splatCount }, i) => budget.stages.count.record(pass, budget.count[i], splatCount));
  budget.stages.threshold.record(pass, budget.threshold);
}

/** Streamed scenes that are due to record page requests in this frame. */
function feedbackDue({ bindings, camera, settings }: Frame): PageRequests[] {
  const all = new Set(bindings.pages.flatMap(({ requests }) => (requests ? [requests.of] : [])));
  return [...all].filter((requests) => requests.isDue(camera, settings));
}

function recordFeedback(pass: GPUComputePassEncoder, { bindings }: Frame, due: readonly PageRequests[]): void {
  for (const { requests, splatCount } of bindings.pages) {
    if (requests && due.includes(requests.of)) requests.of.note(pass, requests.note, splatCount);
  }
}

/** Lists the visible splats of the last frame again, over their order: the list is the same as in that frame. */
export function recordSurvivors(pass: GPUComputePassEncoder, frame: Pick<Frame, 'stages' | 'bindings'>): void {
  cull(pass, frame);
  listSurvivors(pass, frame);
}

/** Finds the visible splats: culls whole chunks first, then single splats. */
function cull(pass: GPUComputePassEncoder, { bindings }: Pick<Frame, 'bindings'>): void {
  for (const { reading, cullChunks, splatCount } of bindings.pages)
    reading.cullChunks.record(pass, cullChunks, splatCount);
  for (const { reading, cull: bound, splatCount } of bindings.pages) reading.cull.record(pass, bound, splatCount);
}

function listSurvivors(pass: GPUComputePassEncoder, { stages, bindings }: Pick<Frame, 'stages' | 'bindings'>): void {
  stages.plan.record(pass, bindings.plan);
  for (const { compact, splatCount } of bindings.pages) stages.compact.record(pass, compact, splatCount);
}

/** Sorts the projected splats from near to far; splats of equal depth keep the order of the file. */
function sort(encoder: GPUCommandEncoder, { stages, bindings, scratch, settings, timer }: Frame): void {
  const pass = encoder.beginComputePass({ label: 'gs.sort', timestampWrites: timer?.timestampWrites('sort') });
  stages.sort.record(pass, bindings.sort(settings.depthKeyBits), scratch.capacity);
  pass.end();
}
