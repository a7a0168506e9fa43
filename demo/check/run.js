/** Modules that the checker's page loads to run a model. */
export { runInPage } from '@gaussian-splat/check/page';
export { openModel, setRuntimeLocation } from '@gaussian-splat/generator';
export { deviceDescriptor } from '@gaussian-splat/renderer';
