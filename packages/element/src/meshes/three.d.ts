/**
 * As much of three.js as is used here. `npm run build` makes the module, of scripts/three.mjs: apps need not install three.js, nor its types, which bring
 * eight more packages.
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
}
/** Where a ray meets a triangle. */
export interface Intersection {
  readonly distance: number;
  readonly object: Object3D;
  readonly face?: { readonly materialIndex: number } | null;
}
export class Raycaster {
  constructor(origin: Vector3, direction: Vector3);
  readonly layers: Layers;
  /** Nearest first. */
  intersectObject(object: Object3D, recursive: boolean): Intersection[];
}
export class Box3 {
  min: Vector3;
  max: Vector3;
  setFromObject(object: Object3D, precise?: boolean): this;
  isEmpty(): boolean;
}
/** Which of 32 kinds an object is of, or a camera sees. */
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
/** The prefiltered light of all directions, of which three.js reads a level by the roughness of a material. */
export interface CubeTexture extends Texture {
  readonly mipmaps: { readonly width: number; readonly height: number }[];
  isPMREMTexture: boolean;
}
export class CubeRenderTarget {
  texture: CubeTexture;
  constructor(size: number, options: object);
  dispose(): void;
}
/** A value of a shader. */
export interface ShaderNode {
  readonly rgb: ShaderNode;
  readonly a: ShaderNode;
  clamp(low: number, high: number): ShaderNode;
}
/** What a material has computed: linear light, and alpha. */
export const output: ShaderNode;
export function neutralToneMapping(color: ShaderNode, exposure: number): ShaderNode;
export function sRGBTransferOETF(color: ShaderNode): ShaderNode;
export function vec4(rgb: ShaderNode, a: ShaderNode): ShaderNode;

export class Material {
  name: string;
  /** Of glTF's `KHR_materials_unlit`. */
  readonly isMeshBasicMaterial?: true;
  envMap?: Texture | null;
  envMapIntensity?: number;
  /** What is written in place of {@link output}. */
  outputNode?: ShaderNode;
  transparent: boolean;
  opacity: number;
  depthWrite: boolean;
  alphaTest: number;
  /** Of glTF's `KHR_materials_transmission`. */
  transmission?: number;
  dispose(): void;
}
export interface Attribute {
  readonly count: number;
  readonly array?: { readonly byteLength: number };
}
export class BufferGeometry {
  index: Attribute | null;
  attributes: Readonly<Record<string, Attribute>>;
  dispose(): void;
}
export class Mesh extends Object3D {
  readonly isMesh: true;
  geometry: BufferGeometry;
  material: Material | Material[];
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
export class WebGPURenderer {
  constructor(options: object);
  readonly backend: { get(object: object): { readonly texture?: GPUTexture } };
  init(): Promise<unknown>;
  setRenderTarget(target: RenderTarget | null): void;
  initRenderTarget(target: CubeRenderTarget): void;
  setClearColor(color: number, alpha: number): void;
  autoClearDepth: boolean;
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
  /** Buffer views, accessors and so on, by type and number. */
  readonly cache: { add(key: string, value: Promise<unknown>): void };
  /** Textures of images, by number. */
  readonly sourceCache: Record<number, Promise<Texture>>;
}
export class GLTFLoader {
  register(plugin: (parser: GLTFParser) => { readonly name: string; beforeRoot?(): Promise<void> | null }): this;
  parseAsync(
    data: object,
    path: string,
  ): Promise<{ readonly scene: Group; readonly animations: readonly AnimationClip[] }>;
}

export interface MeshoptDecoder {
  /** Rejects if WebAssembly is forbidden; absent if there is none. */
  readonly ready?: Promise<void>;
  decodeGltfBufferAsync(
    count: number,
    stride: number,
    source: Uint8Array,
    mode: string,
    filter: string | undefined,
  ): Promise<Uint8Array<ArrayBuffer>>;
}
export const loadMeshoptDecoder: () => Promise<MeshoptDecoder>;
