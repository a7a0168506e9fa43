import type { Camera } from '@gaussian-splat/core';
import type { FrameBindings, Stages } from './bindings.js';
import type { PageRequests, FeedbackSettings } from './gaussian-scene.js';
import type { FrameTimer } from './gpu/pass-timer.js';
import type { RenderSettings } from './render-settings.js';
import type { PixelOrder } from './rasterizers/pixel-order.js';
import type { Scratch } from './scratch.js';

/** Inputs of the stages before the rasterizer. All are allocated and bound in advance. */
export interface Frame {
  readonly stages: Stages;
  readonly bindings: FrameBindings;
  readonly scratch: Scratch;
  readonly camera: Camera;
  /** Writes the uniforms of a camera, for subsequent submissions. */
  readonly look: (camera: Camera) => void;
  readonly settings: FeedbackSettings & Pick<RenderSettings, 'depthKeyBits'>;
  /**
   * Whether to keep the indices of the visible splats, by slot, in {@link Scratch.survivors}. Auxiliary outputs need
   * them.
   */
  readonly keepsSurvivors: boolean;
  /** Whether the world has a block with levels of detail. */
  readonly hasDetail: boolean;
  /** Whether to limit the splats to `RenderSettings.splatBudget`. */
  readonly isBudgeted: boolean;
  /** Stages that need the depths of splats at pixels, for an order or a map; undefined without. */
  readonly order: Pick<PixelOrder, 'recordDepths'> | undefined;
  /** Whether the rasterizer needs the depths of the splats. Sort keys must then be depths. */
  readonly keepsDepths: boolean;
  readonly timer?: FrameTimer | undefined;
}

/**
 * Records the stages from Gaussians to sorted splats: cull, project, and sort from near to far. Counts stay in `plan`
 * on the GPU; the CPU reads nothing.
 * @returns Page requests of streamed scenes, to be copied at the end of the frame and read after the submit.
 */
export function recordProjection(encoder: GPUCommandEncoder, frame: Frame): PageRequests[] {
  const { scratch, bindings, timer } = frame;
  const requests = feedbackDue(frame);
  for (const request of requests) request.begin(encoder);
  encoder.clearBuffer(scratch.cullStats);
  if (frame.isBudgeted) encoder.clearBuffer(scratch.detailCounts);
  // Clears the error threshold of an earlier frame with a budget.
  else if (frame.hasDetail) encoder.clearBuffer(scratch.chunkShares, scratch.chunkShares.size - 4);
  const pass = encoder.beginComputePass({ label: 'gs.project', timestampWrites: timer?.timestampWrites('project') });
  if (frame.isBudgeted) keepWithinBudget(pass, bindings);
  cull(pass, frame);
  listSurvivors(pass, frame);
  for (const { reading, project, splatCount } of bindings.blocks) {
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

/** Records the search for the error threshold in pixels that keeps the frame within its splat budget. */
function keepWithinBudget(pass: GPUComputePassEncoder, { blocks, budget }: FrameBindings): void {
  if (!budget) return;
  blocks.forEach(({ splatCount }, i) => budget.stages.count.record(pass, budget.count[i], splatCount));
  budget.stages.threshold.record(pass, budget.threshold);
}

/** Returns the page requests of the streamed scenes that are due for recording in this frame. */
function feedbackDue({ bindings, camera, settings }: Frame): PageRequests[] {
  const all = new Set(bindings.blocks.flatMap(({ requests }) => (requests ? [requests.of] : [])));
  return [...all].filter((requests) => requests.isDue(camera, settings, bindings.table.world.changes));
}

function recordFeedback(pass: GPUComputePassEncoder, { bindings }: Frame, due: readonly PageRequests[]): void {
  for (const { requests, splatCount } of bindings.blocks) {
    if (requests && due.includes(requests.of)) requests.of.note(pass, requests.note, splatCount);
  }
}

/**
 * Lists the visible splats of the last frame again, in place of their order. The list equals that of the last frame.
 */
export function recordSurvivors(pass: GPUComputePassEncoder, frame: Pick<Frame, 'stages' | 'bindings'>): void {
  cull(pass, frame);
  listSurvivors(pass, frame);
}

/** Finds the visible splats: culls whole chunks first, then single splats. */
function cull(pass: GPUComputePassEncoder, { bindings }: Pick<Frame, 'bindings'>): void {
  for (const { reading, cullChunks, splatCount } of bindings.blocks)
    reading.cullChunks.record(pass, cullChunks, splatCount);
  for (const { reading, cull: bound, splatCount } of bindings.blocks) reading.cull.record(pass, bound, splatCount);
}

function listSurvivors(pass: GPUComputePassEncoder, { stages, bindings }: Pick<Frame, 'stages' | 'bindings'>): void {
  stages.plan.record(pass, bindings.plan);
  for (const { compact, splatCount } of bindings.blocks) stages.compact.record(pass, compact, splatCount);
}

/** Sorts the projected splats from near to far; splats of equal depth keep the order of the file. */
function sort(encoder: GPUCommandEncoder, { stages, bindings, scratch, settings, timer }: Frame): void {
  const pass = encoder.beginComputePass({ label: 'gs.sort', timestampWrites: timer?.timestampWrites('sort') });
  stages.sort.record(pass, bindings.sort(settings.depthKeyBits), scratch.capacity);
  pass.end();
}
