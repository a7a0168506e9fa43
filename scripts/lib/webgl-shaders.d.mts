export const NAGA: string;
export const WEBGL_SHADERS: string;
export function digestOfSource(): string;
export function hasNaga(): boolean;
export function webglShaders(): Promise<string>;
