import type { Convolution, OnnxHeader } from './header.js';

/**
 * Convolutions that ONNX Runtime's WebGPU provider computes wrongly, without a word (onnxruntime-web 1.30.0, and onnxruntime-webgpu 1.27.0 before
 * it; tests/generator/browser/provider.test.ts tries whether it still does): of 6, 9, 15, 18 ... channels, a multiple of 3 that is none of 4, to a multiple of 4, by a
 * kernel of more than one pixel.
 */
export function miscomputedConvolutions({ convolutions }: OnnxHeader): Convolution[] {
  return convolutions.filter(
    ({ inputs, outputs, kernel }) =>
      inputs > 3 && inputs % 3 === 0 && inputs % 4 !== 0 && outputs % 4 === 0 && Math.max(...kernel) > 1,
  );
}
