export { bindInputs, sameInputs, type InputValue } from './bind-inputs.js';
export { inOrder, projectionMatrix, viewMatrix, viewProjectionMatrix } from './camera-matrices.js';
export type { GeneratorState } from './state.js';
