import type { Camera, ShDegree, Vector3 } from '@gaussian-splat/core';
import type { GeometryReading } from './geometry-reading.js';
import type { Resource } from './gpu/kernel.js';
import type { RenderSettings } from './render-settings.js';
import type { DetailBudget } from './stages/detail-budget.js';
import type { ShPrecision } from './pack/words.js';

/** As many Gaussians as fit the largest buffer that a shader can bind on the device. */
export interface GaussianPage {
  readonly count: number;
  /** array<PackedGaussian>, unless {@link reading} says otherwise */
  readonly geometry: GPUBuffer;
  /** Of a page with geometry of another kind. */
  readonly reading?: GeometryReading;
  /** array<vec2u>: spherical harmonics, see pack/sh.ts */
  readonly sh: GPUBuffer;
  /** array<Chunk>: bounds of each 256 splats */
  readonly chunks: GPUBuffer;
  /** array<ChunkDetail>, if there are levels of detail. */
  readonly details?: GPUBuffer;
}

/** What {@link PageRequests} are noted from: a view, and of a page of the pool what lies there. */
export type FeedbackInputs = Readonly<Record<'view' | 'chunks' | 'details' | 'chunk_shares', Resource>>;

/** Settings that say which pages a view asks for. */
export type FeedbackSettings = Pick<RenderSettings, 'detail' | 'detailFade' | 'splatBudget'>;

/** Carries the pages that a view asks for from a frame to the code that fetches them. Streamed scenes bring their own, so that no other page loads it. */
export interface PageRequests {
  /** Binds a page of the pool, for {@link PageRequests.note}. */
  bind(page: FeedbackInputs): GPUBindGroup;
  /** Called with the camera and the settings of each frame. True for one in which to note them; then the other four are called in turn, `note` for each page of the pool, `read` after the submit. */
  isDue(camera: Camera, levers: FeedbackSettings): boolean;
  begin(encoder: GPUCommandEncoder): void;
  note(pass: GPUComputePassEncoder, bindings: GPUBindGroup, splatCount: number): void;
  copy(encoder: GPUCommandEncoder): void;
  read(): void;
}

/**
 * What a {@link Viewpoint} draws: Gaussians on the GPU. `GaussianBuffers` holds those of a file, `DynamicGaussians` those that a
 * generator writes. Everything but the content of the buffers stays the same for as long as the scene lives.
 */
export interface GaussianScene {
  /** Splats for which there is room; all of them are drawn, but for those that paint nothing. */
  readonly count: number;
  readonly shDegree: ShDegree;
  readonly shPrecision: ShPrecision;
  /** True if the scene was trained with opacity compensation; the renderer follows. */
  readonly antialiased: boolean;
  /** Variance in px² of the screen-space low-pass filter that the scene was trained with; undefined is the classic 0.3. */
  readonly filterVariance?: number | undefined;
  /** World position, in float64, that the positions on the GPU are relative to. */
  readonly origin: Vector3;
  readonly pages: readonly GaussianPage[];
  /** Of a scene with levels of detail: what keeps its frames within `RenderSettings.splatBudget`. Such scenes bring it, so that no other page loads it. */
  readonly detailBudget?: DetailBudget | undefined;
  /** Of a scene that is streamed: where views record the pages that they need. */
  readonly pageRequests?: PageRequests;
  /** Called before each frame: a streamed scene uploads what has come. */
  update?(): void;
  /** Grows whenever the content of the buffers changes; 0 for a scene that never does. */
  readonly version: number;
}
