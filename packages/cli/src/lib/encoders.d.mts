import type { EncodeWebp } from '@gaussian-splat/optimize';
export const encodeWebp: EncodeWebp;
export function deflate(bytes: Uint8Array): Uint8Array;
export function deflateQuickly(bytes: Uint8Array): Uint8Array;
