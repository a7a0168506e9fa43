import type { DecoderScript } from './wasm-decoder.js';

/** A KTX2 file of the transcoder. */
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
/** The used part of Basis Universal's transcoder. */
export interface Basis {
  initializeBasis(): void;
  readonly KTX2File: new (bytes: Uint8Array) => Ktx2;
}

/** `npm run build` writes this module: scripts/decoders.mjs. */
export const create: DecoderScript<Basis>['create'];
export const wasm: string;
