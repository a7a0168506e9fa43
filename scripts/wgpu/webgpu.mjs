/** Stands for the module `webgpu` in Deno, which has WebGPU of its own: wgpu, as Firefox has. */
export const globals = {};
export const create = () => navigator.gpu;
