/** The code that the scene worker loads for the WebGL renderer. */
export { sortSplats, type SortAnswer, type SortRequest } from '@gaussian-splat/renderer/webgl';
