import type { DecoderScript } from './wasm-decoder.js';

/** A KTX2 file that the transcoder has opened. */
interface Ktx2 {
  isValid(): boolean;
  isHDR(): boolean;
  getWidth(): number;
  getHeight(): number;
  startTranscoding(): boolean;
  transcodeImage(
    target: Uint8Array,
    level: number,
    layer: number,
    face: number,
    format: number,
    alphaOfOpaque: number,
    channel0: number,
    channel1: number,
  ): boolean;
  close(): void;
  delete(): void;
}
/** Part of the interface of Basis Universal's transcoder that this package uses. */
export interface Basis {
  initializeBasis(): void;
  readonly KTX2File: new (bytes: Uint8Array) => Ktx2;
}

/** Creates the transcoder. `npm run build` writes this module by scripts/decoders.mjs. */
export const create: DecoderScript<Basis>['create'];
export const wasm: string;
