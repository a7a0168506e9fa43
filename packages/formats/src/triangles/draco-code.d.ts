import type { DecoderScript } from './wasm-decoder.js';

/** An object in the memory of the decoder's WebAssembly. */
interface Owned {
  readonly ptr: number;
}
export interface DracoMesh extends Owned {
  num_points(): number;
  num_faces(): number;
}
export interface DracoAttribute extends Owned {
  num_components(): number;
}
interface Decoder extends Owned {
  DecodeArrayToMesh(bytes: Uint8Array, length: number, mesh: DracoMesh): Owned & { ok(): boolean; error_msg(): string };
  GetEncodedGeometryType(bytes: Uint8Array): number;
  GetAttributeByUniqueId(mesh: DracoMesh, id: number): DracoAttribute;
  GetAttributeDataArrayForAllPoints(
    mesh: DracoMesh,
    attribute: DracoAttribute,
    type: number,
    bytes: number,
    pointer: number,
  ): boolean;
  GetTrianglesUInt32Array(mesh: DracoMesh, bytes: number, pointer: number): boolean;
}
/** Part of the interface of Draco's decoder that this package uses. */
export interface Draco {
  readonly Decoder: new () => Decoder;
  readonly Mesh: new () => DracoMesh;
  readonly TRIANGULAR_MESH: number;
  readonly DT_INT8: number;
  readonly DT_UINT8: number;
  readonly DT_INT16: number;
  readonly DT_UINT16: number;
  readonly DT_UINT32: number;
  readonly DT_FLOAT32: number;
  /** Memory of the decoder. It is another array after the memory has grown. */
  readonly HEAPU8: Uint8Array<ArrayBuffer>;
  _malloc(bytes: number): number;
  _free(pointer: number): void;
  destroy(object: Owned): void;
}

/** Creates the decoder. `npm run build` writes this module by scripts/decoders.mjs. */
export const create: DecoderScript<Draco>['create'];
export const wasm: string;
