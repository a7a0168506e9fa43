export { bindInputs } from './bind-inputs.js';
export { imageShapeOf } from './bind-images.js';
export { inOrder, projectionMatrix, viewMatrix, viewProjectionMatrix } from './camera-matrices.js';
export { groupInstances, inputsOfInstances, stackInputs } from './batch/stack-inputs.js';
export {
  Generator,
  type GaussianModelFile,
  type GaussianSink,
  type GeneratedFrame,
  type GeneratorOptions,
} from './generator.js';
export {
  addGaussianModelToScene,
  GaussianModels,
  loadAllGenerators,
  onFrame,
  onGenerated,
  registerGaussianGenerator,
  runGenerators,
  type FrameUpdate,
  type GaussianModel,
  type GaussianModelScene,
  type MakeSink,
} from './gaussian-models.js';
export { sameInputs, type GpuTensor, type InputNumbers, type Inputs, type InputValue } from './input-value.js';
export { PostProcessor, type FinishedImage, type ImageInput, type PostProcessorOptions } from './post-processor.js';
export { GeneratorSession } from './runtime/generator-session.js';
export { handleCpuRun, type CpuCheckMessage, type StartWorker } from './cpu-check/run-on-cpu.js';
export { compareOutputs, isDifferent, type OutputDifference, type Comparison } from './cpu-check/compare.js';
export type { CpuCheckResult } from './cpu-check/record.js';
export type { RunOutputs, SessionKind } from './runtime/ort-session.js';
export { isRuntimeRequested, RUNTIME_FILES, setRunLimit, setRuntimeLocation } from './runtime/load-runtime.js';
export { readTensors, type TensorPart } from './runtime/tensor-buffers.js';
export { openModel, type GeneratorModel, type ModelSource } from './runtime/open-model.js';
export { acquireSession, type AcquireOptions, type SessionLease } from './runtime/shared-sessions.js';
export type { GeneratorState } from './state.js';
