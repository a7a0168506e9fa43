/** Loaded by the worker when the first coded page has come. */
export { decodePage } from '@gaussian-splat/renderer';
