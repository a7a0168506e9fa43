/**
 * Types of the part of three.js in use. `npm run build` builds the module from scripts/three.mjs, so that apps need
 * neither three.js nor its types, which depend on eight more packages.
 */
export class Matrix4 {
  elements: number[];
  fromArray(elements: ArrayLike<number>): this;
  copy(other: Matrix4): this;
  invert(): this;
}
export class Vector3 {
  constructor(x?: number, y?: number, z?: number);
  x: number;
  y: number;
  z: number;
  set(x: number, y: number, z: number): this;
  copy(other: Vector3): this;
  applyMatrix4(matrix: Matrix4): this;
}
/** Intersection of a ray with a triangle. `distance` is from the origin of the ray. */
export interface Intersection {
  readonly distance: number;
  readonly object: Object3D;
  readonly face?: { readonly materialIndex: number } | null;
}
export class Raycaster {
  constructor(origin: Vector3, direction: Vector3);
  readonly layers: Layers;
  /** Distance from a ray, in world units, within which lines and points are hit. */
  readonly params: { readonly Line: { threshold: number }; readonly Points: { threshold: number } };
  /** Returns all intersections, the nearest first. */
  intersectObject(object: Object3D, recursive: boolean): Intersection[];
}
export class Sphere {
  center: Vector3;
  radius: number;
}
export class Box3 {
  min: Vector3;
  max: Vector3;
  expandByPoint(point: Vector3): this;
  union(box: Box3): this;
  setFromObject(object: Object3D, precise?: boolean): this;
  setFromBufferAttribute(attribute: Attribute): this;
  getBoundingSphere(target: Sphere): Sphere;
  isEmpty(): boolean;
}
/** Layers of an object or camera, as bits of 32: a camera draws the objects that share one of its layers. */
export class Layers {
  set(kind: number): void;
  enableAll(): void;
}
export class Object3D {
  name: string;
  visible: boolean;
  matrix: Matrix4;
  matrixWorld: Matrix4;
  matrixAutoUpdate: boolean;
  frustumCulled: boolean;
  readonly layers: Layers;
  add(...objects: Object3D[]): this;
  remove(...objects: Object3D[]): this;
  traverse(callback: (object: Object3D) => void): void;
  updateMatrixWorld(force?: boolean): void;
}
export class Group extends Object3D {}
export class Scene extends Object3D {}
export class Camera extends Object3D {
  matrixWorldInverse: Matrix4;
  projectionMatrix: Matrix4;
  projectionMatrixInverse: Matrix4;
  coordinateSystem: number;
  _reversedDepth: boolean;
}
export class Texture {
  constructor(image?: ImageBitmap);
  needsUpdate: boolean;
  image?: { readonly width?: number; readonly height?: number; close?: () => void };
  dispose(): void;
}
export class DepthTexture extends Texture {
  constructor(width: number, height: number, type: number);
}
export class RenderTarget {
  texture: Texture;
  depthTexture: DepthTexture | null;
  constructor(width: number, height: number, options: object);
  setSize(width: number, height: number): void;
  dispose(): void;
}
/** Prefiltered light from all directions. Three.js selects a mip level by the roughness of a material. */
export interface CubeTexture extends Texture {
  readonly mipmaps: { readonly width: number; readonly height: number }[];
  isPMREMTexture: boolean;
}
export class CubeRenderTarget {
  texture: CubeTexture;
  constructor(size: number, options: object);
  dispose(): void;
}
/** A value in a shader. */
export interface ShaderNode {
  readonly r: ShaderNode;
  readonly rgb: ShaderNode;
  readonly a: ShaderNode;
  mul(factor: ShaderNode | number): ShaderNode;
  oneMinus(): ShaderNode;
  clamp(low: number, high: number): ShaderNode;
}
/** Result of a material: linear light and alpha. */
export const output: ShaderNode;
/** Property `opacity` of a material. */
export const materialOpacity: ShaderNode;
/** Samples a texture at the coordinates of its channel, with its transform. */
export function texture(value: Texture): ShaderNode;
export function neutralToneMapping(color: ShaderNode, exposure: number): ShaderNode;
export function sRGBTransferOETF(color: ShaderNode): ShaderNode;
export function vec4(rgb: ShaderNode, a: ShaderNode): ShaderNode;

export class Material {
  name: string;
  envMap?: Texture | null;
  /** Undefined for materials that light does not change: `KHR_materials_unlit`, lines and points. */
  envMapIntensity?: number;
  /** Value that is written instead of {@link output}. */
  outputNode?: ShaderNode;
  /** Value that is used instead of {@link materialOpacity}. */
  opacityNode?: ShaderNode;
  transparent: boolean;
  opacity: number;
  depthWrite: boolean;
  colorWrite: boolean;
  /** Whether both sides of a transparent `DoubleSide` material are drawn at once. */
  forceSinglePass: boolean;
  alphaTest: number;
  /** Value that is used instead of {@link alphaTest}. */
  alphaTestNode?: ShaderNode;
  /** Fraction of light that passes through, 0..1: glTF's `KHR_materials_transmission`. */
  transmission?: number;
  /** Texture whose red channel is a factor of {@link transmission}. */
  transmissionMap?: Texture | null;
  dispose(): void;
}
export interface Attribute {
  readonly count: number;
  readonly array?: ArrayLike<number>;
}
export class BufferGeometry {
  index: Attribute | null;
  attributes: Readonly<Record<string, Attribute>>;
  setIndex(indices: number[]): this;
  boundingBox: Box3 | null;
  boundingSphere: Sphere | null;
  readonly morphAttributes: { readonly position?: readonly Attribute[] };
  dispose(): void;
}
/** Triangles, lines (`Line`) or points (`Points`). */
export class Mesh extends Object3D {
  /** Whether it is a line that returns to its start. */
  isLineLoop?: boolean;
  geometry: BufferGeometry;
  material: Material | Material[];
  /** Bounds of a skinned mesh; null until a ray is cast. */
  boundingSphere?: object | null;
}
export interface AnimationClip {
  readonly duration: number;
}
export class AnimationMixer {
  constructor(root: Object3D);
  clipAction(clip: AnimationClip): { play(): void };
  setTime(seconds: number): void;
  stopAllAction(): void;
  uncacheRoot(root: Object3D): void;
}
/** Lights whose number is a uniform: materials are compiled for kinds of lights, not for each light. */
export class DynamicLighting {
  constructor(maxima: {
    readonly maxDirectionalLights: number;
    readonly maxPointLights: number;
    readonly maxSpotLights: number;
  });
}
export interface RenderItem {
  readonly object: Object3D;
  readonly geometry: BufferGeometry;
}
export type RenderObject = (
  object: Object3D,
  scene: Scene,
  camera: Camera,
  geometry: BufferGeometry,
  material: Material,
  group: unknown,
  lights: unknown,
  clipping: unknown,
) => void;
export class WebGPURenderer {
  constructor(options: object);
  lighting: DynamicLighting;
  readonly backend: { get(object: object): { readonly texture?: GPUTexture } };
  init(): Promise<unknown>;
  setRenderTarget(target: RenderTarget | null): void;
  initRenderTarget(target: RenderTarget | CubeRenderTarget): void;
  setClearColor(color: number, alpha: number): void;
  autoClear: boolean;
  autoClearDepth: boolean;
  /** Replaces the order of transparent objects: negative if `a` is drawn first. */
  setTransparentSort(compare: (a: RenderItem, b: RenderItem) => number): void;
  /** Replaces the function that draws an object, which calls {@link renderObject}. */
  setRenderObjectFunction(draw: RenderObject | null): void;
  /** Draws an object. @param pass Name of a pass: pipelines are kept for each. */
  renderObject(...parameters: [...Parameters<RenderObject>, pass: string]): void;
  render(scene: Scene, camera: Camera): void;
  compileAsync(scene: Scene, camera: Camera): Promise<unknown>;
  dispose(): unknown;
  onDeviceLost: (info: unknown) => void;
  onError: (info: { readonly originalEvent?: Event }) => void;
}
export const FloatType: number;
export const HalfFloatType: number;
export const LinearMipmapLinearFilter: number;
export const WebGPUCoordinateSystem: number;

export interface GLTFParser {
  /** Promises of buffer views, accessors and other objects, by type and index: `bufferView:0`. */
  readonly cache: { add(key: string, value: Promise<unknown>): void };
  /** Textures by index of their image. */
  readonly sourceCache: Record<number, Promise<Texture>>;
}
export class GLTFLoader {
  register(plugin: (parser: GLTFParser) => { readonly name: string; beforeRoot?(): Promise<void> | null }): this;
  parseAsync(
    data: object,
    path: string,
  ): Promise<{ readonly scene: Group; readonly animations: readonly AnimationClip[] }>;
}
