import type { Texture, ToneMapping } from './three-webgpu.js';

export function texture(value: Texture): unknown;
export function toneMapping(mapping: ToneMapping, exposure: unknown, color: unknown): unknown;
export const toneMappingExposure: unknown;
