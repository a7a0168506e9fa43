export { GeneratedSplats } from './generated-splats.js';
export { SplatRenderer, type SplatRendererOptions } from './splat-renderer.js';
export { SplatScene, type SplatSceneOptions } from './splat-scene.js';
