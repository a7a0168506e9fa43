/** The worker and the loads of the element, for tests. */
export { LargePly } from '../../../packages/element/src/loading/large-ply.js';
export { loadScene } from '../../../packages/element/src/loading/load-scene.js';
export { openBoxes } from '../../../packages/element/src/loading/lod-boxes.js';
export { openModel } from '../../../packages/element/src/loading/open-model.js';
export { PreviewSchedule } from '../../../packages/element/src/loading/preview-schedule.js';
export type {
  LoadedScene,
  PartListener,
  SceneLimits,
  SceneRequest,
} from '../../../packages/element/src/loading/protocol.js';
export type { SceneLoader } from '../../../packages/element/src/loading/scene-loader.js';
export { runOnPage } from '../../../packages/element/src/loading/scene-worker.js';
export { BOOTSTRAP } from '../../../packages/element/src/loading/worker-bootstrap.js';
export type { CHUNKS } from '../../../packages/element/src/loading/worker-code.js';
export type { WorkerRequest } from '../../../packages/element/src/loading/worker-messages.js';
export { WorkerPool } from '../../../packages/element/src/loading/worker-pool.js';
