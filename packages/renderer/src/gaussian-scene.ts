import type { Camera, ShDegree, Vector3 } from '@gaussian-splat/core';
import type { GeometryReading } from './geometry-reading.js';
import type { Resource } from './gpu/kernel.js';
import type { RenderSettings } from './render-settings.js';
import type { DetailBudget } from './stages/detail-budget.js';
import type { ShPrecision } from './pack/words.js';

/** Gaussians in the largest buffers that a shader can bind on the device. */
export interface GaussianBlock {
  readonly count: number;
  /** array<PackedGaussian>, unless {@link reading} says otherwise */
  readonly geometry: GPUBuffer;
  /** Only for another kind of geometry. */
  readonly reading?: GeometryReading;
  /** array<vec2u>: spherical harmonics, see pack/sh.ts */
  readonly sh: GPUBuffer;
  /** array<Chunk>: bounds of each 256 splats */
  readonly chunks: GPUBuffer;
  /** array<ChunkDetail>, if there are levels of detail. */
  readonly details?: GPUBuffer;
}

/** Inputs of {@link PageRequests}: a view, and the content of a page of the pool. */
export type FeedbackInputs = Readonly<Record<'view' | 'chunks' | 'details' | 'chunk_shares', Resource>>;

/** Settings that influence which pages a view requests. */
export type FeedbackSettings = Pick<RenderSettings, 'detail' | 'detailFade' | 'splatBudget'>;

/**
 * Carries the pages that a view requests from a frame to the streaming code. Streamed scenes provide it, so that it is
 * loaded only with them.
 */
export interface PageRequests {
  /** Binds a page of the pool, for {@link PageRequests.note}. */
  bind(page: FeedbackInputs): GPUBindGroup;
  /**
   * Called with the camera and the settings of each frame. Returns true if this frame should record requests; then the
   * other four are called in turn, `note` for each page of the pool, `read` after the submit.
   */
  isDue(camera: Camera, settings: FeedbackSettings): boolean;
  begin(encoder: GPUCommandEncoder): void;
  note(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void;
  copy(encoder: GPUCommandEncoder): void;
  read(): void;
}

/**
 * Gaussians on the GPU for a {@link Viewpoint}. `GaussianBuffers` holds those of a file, `DynamicGaussians` those of a
 * generator. Only the content of the buffers changes during its lifetime.
 */
export interface GaussianScene {
  /** Capacity in splats; all of them are processed, but transparent ones paint nothing. */
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  /** Whether the scene was trained with opacity compensation, which the renderer then applies. */
  readonly antialiased: boolean;
  /** Variance in px² of the screen-space low-pass filter of training; undefined is the classic 0.3. */
  readonly filterVariance?: number | undefined;
  /** World position, in float64, of the origin of the positions on the GPU. */
  readonly origin: Vector3;
  readonly pages: readonly GaussianBlock[];
  /**
   * Only for a scene with levels of detail: keeps its frames within `RenderSettings.splatBudget`. Such scenes provide
   * it, so that it is loaded only with them.
   */
  readonly detailBudget?: DetailBudget | undefined;
  /** Only for a streamed scene: receives the pages that views need. */
  readonly pageRequests?: PageRequests;
  /** Called before each frame: a streamed scene uploads the received pages. */
  update?(): void;
  /** Incremented whenever the content of the buffers changes; 0 for a scene that never changes. */
  readonly version: number;
}
