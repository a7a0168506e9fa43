/** Loaded by workers that read and pack shares of a large PLY. */
import { readPrefix, samplePreview } from '@gaussian-splat/formats';
import { packShare, type PackedShare, type ShPrecision } from '@gaussian-splat/renderer/tools';
import type { GaussianCloud, ShDegree, Vector3 } from '@gaussian-splat/core';
import { buffersOf } from './protocol.js';

/** Rows of a PLY to be packed. */
export interface ShareRequest {
  readonly share: number;
  /** A PLY: the file's header, and these rows alone. */
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly shPrecision: ShPrecision;
  /** Of the file. */
  readonly name: string;
}

/** What became of them. */
export interface ShareAnswer {
  readonly share: number;
  /** Undefined where none of the rows can be drawn, or they could not be read. */
  readonly packed?: PackedShare;
  /** Some of the splats. */
  readonly preview?: GaussianCloud;
  readonly shDegree?: ShDegree;
  readonly antialiased?: boolean;
  readonly order?: 'pixel' | undefined;
  readonly filterVariance?: number | undefined;
  /** What the file says points up. */
  readonly up?: Vector3 | undefined;
  readonly origin?: Vector3;
  /** What of the file is not drawn. */
  readonly warnings?: readonly string[] | undefined;
}

/** Reads and packs some rows. Never throws for what is in them. */
export async function packRows({ share, bytes, shPrecision, name }: ShareRequest): Promise<ShareAnswer> {
  const cloud = await readPrefix(bytes, { name });
  release(bytes);
  if (cloud === undefined) return { share };
  const { shDegree, antialiased, filterVariance, origin, hints, warnings } = cloud;
  const { positions, scales, rotations, opacities, sh } = cloud;
  const answer = {
    ...{ share, shDegree, antialiased, filterVariance, origin, up: hints?.up, order: hints?.order, warnings },
    packed: packShare(cloud, shPrecision),
    preview: samplePreview(cloud),
  };
  release(positions, scales, rotations, opacities, sh);
  return answer;
}

/** Gives memory back at once. Browsers count such buffers late: without it those of many shares lie side by side. Older ones cannot do it. */
export function release(...arrays: ArrayBufferView[]): void {
  for (const { buffer } of arrays) (buffer as { transfer?: (bytes: number) => unknown }).transfer?.(0);
}

/** Packs what comes through a port until the worker is ended. */
export function packShares(port: MessagePort): void {
  port.addEventListener('message', ({ data }: MessageEvent<ShareRequest>) => {
    // Who waits for the answer does the work again where none comes.
    const answer = (answer: ShareAnswer): void =>
      port.postMessage(answer, answer.packed ? buffersOf(answer.packed, answer.preview ?? {}) : []);
    packRows(data).then(answer, () => answer({ share: data.share }));
  });
  port.start();
}
