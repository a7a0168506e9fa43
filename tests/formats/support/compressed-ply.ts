/** Writer of compressed PLYs. */
import type { PlyColumn, PlyWriterElement } from './ply-writer.js';

export const BOUNDS: Record<string, number> = {
  min_x: -2,
  min_y: 0,
  min_z: 10,
  max_x: 2,
  max_y: 1,
  max_z: 20,
  min_scale_x: -6,
  min_scale_y: -5,
  min_scale_z: -4,
  max_scale_x: -1,
  max_scale_y: -2,
  max_scale_z: -3,
};
export const COLOR_BOUNDS: Record<string, number> = {
  min_r: -1,
  min_g: 0,
  min_b: 0.25,
  max_r: 1,
  max_g: 2,
  max_b: 0.75,
};

export interface PackedSplat {
  readonly position?: number;
  readonly rotation?: number;
  readonly scale?: number;
  readonly color?: number;
  readonly rest?: readonly number[];
}

/** Elements of a compressed PLY; chunks have the same bounds. */
export function compressed(splats: readonly PackedSplat[], bounds = BOUNDS, chunks = 1): PlyWriterElement[] {
  const column = (name: string, type: PlyColumn['type'], values: readonly number[]): PlyColumn => ({
    name,
    type,
    values,
  });
  const elements: PlyWriterElement[] = [
    {
      name: 'chunk',
      columns: Object.entries(bounds).map(([name, value]) => column(name, 'float', Array(chunks).fill(value))),
    },
    {
      name: 'vertex',
      columns: [
        column(
          'packed_position',
          'uint',
          splats.map((s) => s.position ?? 0),
        ),
        column(
          'packed_rotation',
          'uint',
          splats.map((s) => s.rotation ?? 0x1ff7fdff),
        ),
        column(
          'packed_scale',
          'uint',
          splats.map((s) => s.scale ?? 0),
        ),
        column(
          'packed_color',
          'uint',
          splats.map((s) => s.color ?? 0xffffffff),
        ),
      ],
    },
  ];
  const restCount = splats[0]?.rest?.length ?? 0;
  if (restCount > 0) {
    elements.push({
      name: 'sh',
      columns: Array.from({ length: restCount }, (_, k) =>
        column(
          `f_rest_${k}`,
          'uchar',
          splats.map((s) => s.rest?.[k] ?? 0),
        ),
      ),
    });
  }
  return elements;
}
