/** What this package uses of three.js, which brings no types of its own. Pages that use `@types/three` see those. */
export class Matrix4 {
  readonly elements: number[];
  copy(matrix: Matrix4): this;
  determinant(): number;
  invert(): this;
  multiply(matrix: Matrix4): this;
  compose(position: Vector3, quaternion: Quaternion, scale: Vector3): this;
  decompose(position: Vector3, quaternion: Quaternion, scale: Vector3): this;
}

export class Quaternion {}

export class Vector2 {
  x: number;
  y: number;
}

export class Layers {
  test(layers: Layers): boolean;
}

export class Vector3 {
  constructor(x?: number, y?: number, z?: number);
  set(x: number, y: number, z: number): this;
  setScalar(value: number): this;
}

export class Euler {
  y: number;
  set(x: number, y: number, z: number): this;
}

export class Object3D {
  readonly isObject3D: true;
  readonly children: readonly Object3D[];
  readonly position: Vector3;
  readonly rotation: Euler;
  readonly scale: Vector3;
  add(...objects: Object3D[]): this;
  remove(object: Object3D): this;
  removeFromParent(): this;
  lookAt(x: number, y: number, z: number): void;
  type: string;
  visible: boolean;
  readonly layers: Layers;
  readonly matrixWorld: Matrix4;
  updateWorldMatrix(updateParents: boolean, updateChildren: boolean): void;
  traverseVisible(callback: (object: Object3D) => void): void;
}

export class Camera extends Object3D {
  readonly matrixWorldInverse: Matrix4;
  readonly projectionMatrix: Matrix4;
  readonly coordinateSystem: number;
  readonly reversedDepth: boolean;
}

export class PerspectiveCamera extends Camera {
  constructor(fov: number, aspect: number, near: number, far: number);
}

export class OrthographicCamera extends Camera {
  constructor(left: number, right: number, top: number, bottom: number, near: number, far: number);
}

export class Color {
  setRGB(red: number, green: number, blue: number, colorSpace: string): this;
}

export class Scene extends Object3D {
  background: Color | null;
}

export class BoxGeometry {
  constructor(width: number, height: number, depth: number);
}

export class MeshBasicMaterial {
  constructor(options: { color: number });
}

export class Mesh extends Object3D {
  constructor(geometry: BoxGeometry, material: MeshBasicMaterial);
}

export class Texture {
  dispose(): void;
}

export class DepthTexture extends Texture {
  constructor(width: number, height: number, type?: number);
}

export class RenderTarget {
  constructor(width: number, height: number, options?: object);
  readonly width: number;
  readonly height: number;
  readonly texture: Texture;
  depthTexture: DepthTexture | null;
  setSize(width: number, height: number): void;
  dispose(): void;
}

export class NodeMaterial {
  fragmentNode: unknown;
  depthTest: boolean;
  depthWrite: boolean;
  dispose(): void;
}

export class QuadMesh {
  constructor(material: NodeMaterial);
  render(renderer: WebGPURenderer): void;
}

export class WebGPURenderer {
  constructor(options?: { readonly canvas?: HTMLCanvasElement; readonly antialias?: boolean });
  init(): Promise<this>;
  setSize(width: number, height: number, updateStyle?: boolean): void;
  dispose(): void;
  toneMapping: ToneMapping;
  readonly isOutputTarget: boolean;
  readonly backend: {
    readonly isWebGPUBackend?: boolean;
    readonly device?: GPUDevice | null;
    get(texture: Texture): { texture?: GPUTexture };
  };
  getDrawingBufferSize(size: Vector2): Vector2;
  getRenderTarget(): RenderTarget | null;
  setRenderTarget(target: RenderTarget | null): void;
  render(scene: Object3D, camera: Camera): void;
}

export const FloatType: number;
export const HalfFloatType: number;
export const WebGPUCoordinateSystem: number;
export type ToneMapping = number;
export const NoToneMapping: ToneMapping;
export const ACESFilmicToneMapping: ToneMapping;
