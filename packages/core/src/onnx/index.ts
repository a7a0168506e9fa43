export { blobSource, bytesSource, type ByteSource } from './byte-source.js';
export { externalUrl } from './external-url.js';
export {
  describeTensor,
  type ExternalFile,
  type OnnxDim,
  type OnnxDtype,
  type OnnxHeader,
  type OnnxNode,
  type OnnxTensor,
  type OnnxValue,
} from './header.js';
export {
  constantOutputs,
  gpuFindings,
  gpuNotes,
  miscomputedNodes,
  misfusedProducts,
  uncastableTypes,
  type GpuFinding,
} from './webgpu-provider.js';
export { WEBGPU_RULES } from './webgpu-rules.js';
export { modelMemory, type ModelMemory } from './model-memory.js';
export { openHeader, type ModelPlace, type OpenedModel } from './open-header.js';
export { readOnnxHeader } from './read-onnx-header.js';
export { openUrl, type UrlSource, type UrlSourceOptions } from './url-source.js';
