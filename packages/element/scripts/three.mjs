/** Exports of three.js that the element uses, for src/sources/mesh/three.d.ts. */
export {
  AnimationMixer,
  Box3,
  Camera,
  CubeRenderTarget,
  DepthTexture,
  FloatType,
  HalfFloatType,
  LinearMipmapLinearFilter,
  Raycaster,
  RenderTarget,
  Scene,
  Sphere,
  Texture,
  Vector3,
  WebGPUCoordinateSystem,
  WebGPURenderer,
} from 'three/webgpu';
export { materialOpacity, neutralToneMapping, output, sRGBTransferOETF, texture, vec4 } from 'three/tsl';
export { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
export { DynamicLighting } from 'three/addons/lighting/DynamicLighting.js';
