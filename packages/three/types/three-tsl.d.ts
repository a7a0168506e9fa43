import type { Texture } from './three-webgpu.js';

export function texture(value: Texture): unknown;
