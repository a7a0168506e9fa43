import { GaussianSplatError } from '@gaussian-splat/core';
import type { AttributeSlice, GaussianAttribute, GaussianLayout } from '@gaussian-splat/core/contract';
import type * as layouts from './generated/live-layouts.js';
import { constants } from './generated/shaders.js';
import { BUFFER_USAGE, type Resource } from './gpu/kernel.js';
import type { GpuMemory } from './gpu/memory.js';
import type { StructValues } from './gpu/struct.js';

/** Bindings of shaders/ingest.wgsl, and the attributes that each of them can contain. Rotations are optional. */
const BINDINGS = {
  positions: ['positions'],
  shapes: ['covariances', 'scales'],
  rotations: ['rotations'],
  colors: ['colors', 'sh'],
  opacities: ['opacities'],
} as const satisfies Record<string, readonly GaussianAttribute[]>;

type Binding = keyof typeof BINDINGS;
const BINDING_NAMES = Object.keys(BINDINGS) as Binding[];

/** Rows of a tensor that belong to a block. */
interface RowRange {
  readonly first: number;
  readonly count: number;
}

/** Finds the regions of a generator's tensors for the bindings of shaders/ingest.wgsl. */
export class TensorBindings {
  readonly #layout: GaussianLayout;
  readonly #elementBytes: number;
  readonly #slices: Readonly<Record<Binding, AttributeSlice | undefined>>;
  /** Placeholder buffer for missing tensors. */
  readonly #nothing: GPUBuffer;
  readonly #numbers = new WeakMap<GPUBuffer, number>();
  #lastNumber = 0;

  constructor(layout: GaussianLayout, memory: GpuMemory) {
    this.#layout = layout;
    this.#elementBytes = layout.dtype === 'float16' ? 2 : 4;
    this.#slices = slicesOf(layout);
    this.#nothing = memory.buffer('gs.ingest.nothing', 4, BUFFER_USAGE.storage);
  }

  /** Number of bytes of a row in the widest tensor. */
  get bytesPerRow(): number {
    return this.#elementBytes * Math.max(...this.#layout.attributes.map(({ rowStride }) => rowStride));
  }

  /**
   * Checks the tensors of a run.
   * @throws GaussianSplatError `argument/value` unless every tensor is present and large enough.
   */
  check(tensors: Readonly<Record<string, GPUBuffer>>, rows: number, instance: number): void {
    if (rows === 0) return;
    const all = (instance + 1) * rows;
    for (const { tensor, rowStride } of this.#layout.attributes) {
      const min = Math.ceil((all * rowStride * this.#elementBytes) / 4) * 4;
      requireBytes(tensor, tensors[tensor], min);
    }
    if (this.#layout.count !== undefined)
      requireBytes(this.#layout.count, tensors[this.#layout.count], countBytes(this.#layout) * (instance + 1));
  }

  /** Returns a key of the buffers that a run binds: equal for the same buffers. */
  keyOf(tensors: Readonly<Record<string, GPUBuffer>>): string {
    let key = '';
    for (const name of BINDING_NAMES) {
      const slice = this.#slices[name];
      const buffer = slice && tensors[slice.tensor];
      key += `${buffer ? this.#numberOf(buffer) : 0} `;
    }
    return key;
  }

  /**
   * Returns the resources for the bindings of a block. A placeholder replaces tensors without rows for it.
   * @param before Rows of other scenes in the same tensors, in front of the rows of this scene.
   */
  resources(
    tensors: Readonly<Record<string, GPUBuffer>>,
    { first, count }: RowRange,
    before: number,
  ): Record<Binding, Resource> {
    const resourceOf = (name: Binding): Resource => {
      const slice = this.#slices[name];
      const buffer = slice && tensors[slice.tensor];
      if (slice === undefined || buffer === undefined) return this.#nothing;
      const rowBytes = slice.rowStride * this.#elementBytes;
      const { offset, skipped } = placeOf((before + first) * rowBytes);
      const size = Math.min(
        Math.ceil((skipped + count * rowBytes) / 4) * 4,
        Math.floor((buffer.size - offset) / 4) * 4,
      );
      return size <= skipped ? this.#nothing : { buffer, offset, size };
    };
    return {
      positions: resourceOf('positions'),
      shapes: resourceOf('shapes'),
      rotations: resourceOf('rotations'),
      colors: resourceOf('colors'),
      opacities: resourceOf('opacities'),
    };
  }

  #numberOf(buffer: GPUBuffer): number {
    let number = this.#numbers.get(buffer);
    if (number === undefined) this.#numbers.set(buffer, (number = ++this.#lastNumber));
    return number;
  }
}

/** Returns the size of a count of valid rows in bytes: 8 for int64, whose lower half is first, otherwise 4. */
export const countBytes = ({ countDtype }: GaussianLayout): number => (countDtype === 'int64' ? 8 : 4);

/** Alignment of the offsets of bindings in bytes: the largest that a device may require. */
const ALIGNMENT = 256;

/** Returns the largest aligned offset that is at most `byte`, and the number of bytes from there to `byte`. */
function placeOf(byte: number): { readonly offset: number; readonly skipped: number } {
  const offset = Math.floor(byte / ALIGNMENT) * ALIGNMENT;
  return { offset, skipped: byte - offset };
}

/**
 * Returns the values of the `Ingest` uniform of a block before any run.
 * @param first Index of the block's first row among all rows.
 * @param before Rows of other scenes in the same tensors, in front of the rows of this scene.
 */
export function ingestValues(
  layout: GaussianLayout,
  first: number,
  count: number,
  before: number,
): StructValues<typeof layouts.Ingest> {
  const slices = slicesOf(layout);
  const elementBytes = layout.dtype === 'float16' ? 2 : 4;
  const place = (name: Binding): number[] => {
    const { offset = 0, rowStride = 0 } = slices[name] ?? {};
    return [placeOf((before + first) * rowStride * elementBytes).skipped / elementBytes + offset, rowStride];
  };
  return {
    count: 0,
    rows: 0,
    page_rows: count,
    first_row: first,
    is_half: layout.dtype === 'float16' ? 1 : 0,
    shape_kind: shapeKind(slices.shapes),
    shape_numbers: slices.shapes?.components ?? 6,
    color_kind: colorKind(slices.colors),
    sh_degree: layout.shDegree ?? 0,
    is_w_first: slices.rotations?.quaternionOrder === 'wxyz' ? 1 : 0,
    is_logit: slices.opacities?.activation === 'logit' ? 1 : 0,
    positions: place('positions'),
    shapes: place('shapes'),
    rotations: place('rotations'),
    colors: place('colors'),
    opacities: place('opacities'),
  };
}

function slicesOf({ attributes }: GaussianLayout): Record<Binding, AttributeSlice | undefined> {
  const find = (names: readonly GaussianAttribute[]): AttributeSlice | undefined =>
    attributes.find(({ attribute }) => names.includes(attribute));
  return {
    positions: find(BINDINGS.positions),
    shapes: find(BINDINGS.shapes),
    rotations: find(BINDINGS.rotations),
    colors: find(BINDINGS.colors),
    opacities: find(BINDINGS.opacities),
  };
}

function shapeKind(slice: AttributeSlice | undefined): number {
  if (slice?.attribute === 'covariances') return constants.SHAPE_COVARIANCE;
  return slice?.activation === 'log' ? constants.SHAPE_LOG_SCALE : constants.SHAPE_SCALE;
}

function colorKind(slice: AttributeSlice | undefined): number {
  if (slice?.attribute !== 'sh') return constants.COLOR_RGB;
  return slice.shOrder === 'channel-major' ? constants.COLOR_CHANNEL_MAJOR : constants.COLOR_COEFFICIENT_MAJOR;
}

function requireBytes(name: string, buffer: GPUBuffer | undefined, min: number): void {
  if (buffer !== undefined && buffer.size >= min) return;
  throw new GaussianSplatError('argument/value', {
    where: `tensor ${name}`,
    expected: `a storage buffer of at least ${min} bytes`,
    found: buffer === undefined ? 'none' : `${buffer.size} bytes`,
    remedy: 'pass the buffers that the run wrote, and the number of rows that it wrote',
  });
}
