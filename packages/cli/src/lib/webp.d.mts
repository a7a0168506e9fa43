import type { EncodeWebp } from '@gaussian-splat/economise';
export const encodeWebp: EncodeWebp;
