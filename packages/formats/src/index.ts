export { detectFormat } from './detect.js';
export { fetchScene, type FetchSceneOptions } from './fetch-scene.js';
export { sceneFormats } from './formats.js';
export { openPartAt } from './open-part.js';
export { readPrefix, readScene, type ReadSceneOptions } from './read-scene.js';
export { isSequence } from './is-sequence.js';
export type { FileBytes } from './bytes.js';
export { frameAt, parseSequence, type SceneSequence } from './sequence.js';
export type { OpenPart, SceneFormat, SceneFormatName, SceneReader, SceneSource } from './scene-format.js';
