export { blobSource, bytesSource, type ByteSource } from './byte-source.js';
export {
  describeTensor,
  type Convolution,
  type ExternalFile,
  type OnnxDim,
  type OnnxDtype,
  type OnnxHeader,
  type OnnxTensor,
} from './header.js';
export { gpuNotes, miscomputedConvolutions, uncastableTypes } from './webgpu-provider.js';
export { readOnnxHeader } from './read-onnx-header.js';
export { openUrl, type UrlSource, type UrlSourceOptions } from './url-source.js';
