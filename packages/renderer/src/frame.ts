import type { PassTimer } from './gpu/pass-timer.js';
import type { FramePage } from './page-table.js';
import type { Accumulation, Rasterizer } from './rasterizers/rasterizer.js';
import { planOffsets } from './scratch.js';
import type { CompactStage } from './stages/compact.js';
import type { ComposeStage } from './stages/compose.js';
import type { CullStage } from './stages/cull.js';
import type { PlanStage } from './stages/plan.js';
import type { ProjectStage } from './stages/project.js';
import type { ScanStage } from './stages/scan.js';
import type { SortBindings, SortStage } from './stages/sort.js';

/** The stages of the renderer; each is a shader of the same name. */
export interface Stages {
  readonly cull: CullStage;
  readonly scan: ScanStage;
  readonly plan: PlanStage;
  readonly compact: CompactStage;
  readonly project: ProjectStage;
  readonly sort: SortStage;
  readonly compose: ComposeStage;
}

/** Everything that one frame needs, bound and allocated beforehand. */
export interface Frame {
  readonly stages: Stages;
  readonly pages: readonly FramePage[];
  readonly plan: GPUBuffer;
  readonly scan: GPUBindGroup;
  readonly makePlan: GPUBindGroup;
  readonly sort: SortBindings;
  readonly rasterizer: Rasterizer;
  readonly accumulation: Accumulation;
  readonly compose: GPUBindGroup;
  readonly target: GPUTextureView;
  readonly targetFormat: GPUTextureFormat;
  readonly timer?: PassTimer;
}

/** Records a frame: project, sort, rasterize, compose. Counts travel in `plan`; nothing comes back to the CPU. */
export function recordFrame(encoder: GPUCommandEncoder, frame: Frame): void {
  const { rasterizer, accumulation, stages, compose, target, targetFormat, timer } = frame;
  timer?.startFrame();
  project(encoder, frame);
  sort(encoder, frame);
  rasterizer.record(encoder, accumulation, timer);
  stages.compose.record(encoder, compose, target, targetFormat, timer);
}

/** Finds the visible splats, lists them in the file's order, and projects those alone. */
function project(encoder: GPUCommandEncoder, { stages, pages, plan, scan, makePlan, timer }: Frame): void {
  encoder.clearBuffer(plan, planOffsets.gathered.offset, planOffsets.gathered.size);
  const pass = encoder.beginComputePass({ label: 'gs.project', timestampWrites: timer?.timestampWrites('project') });
  for (const { page, cull } of pages) stages.cull.record(pass, cull, page.count);
  stages.scan.record(pass, scan);
  stages.plan.record(pass, makePlan);
  for (const { page, compact } of pages) stages.compact.record(pass, compact, page.count);
  pages.forEach(({ project }, i) => stages.project.record(pass, project, plan, i));
  pass.end();
}

/** Orders the projected splats from near to far, equal depths in the file's order. */
function sort(encoder: GPUCommandEncoder, { stages, plan, sort: bindings, timer }: Frame): void {
  const pass = encoder.beginComputePass({ label: 'gs.sort', timestampWrites: timer?.timestampWrites('sort') });
  stages.sort.record(pass, bindings, plan);
  pass.end();
}
