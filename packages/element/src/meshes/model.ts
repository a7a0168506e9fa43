import { GaussianSplatError, type Bounds, type Vector3 } from '@gaussian-splat/core';
import {
  AnimationMixer,
  Box3,
  GLTFLoader,
  LoadingManager,
  loadMeshoptDecoder,
  type GLTFParser,
  type Group,
  type Material,
  type Mesh,
  type Object3D,
  type Texture,
} from './three.js';

/** Splats in a glTF: the renderer of splats shows them. */
const SPLATS = 'KHR_gaussian_splatting';
/** Just before the end: at the end itself an animation begins anew. */
const BEFORE_END = 1e-4;
/** Of a texture with all of its smaller levels, bytes a pixel. */
const TEXEL_BYTES = (4 * 4) / 3;

export interface ModelRequest {
  /** Absolute address, for messages and for the files beside it. */
  readonly url: string;
  readonly credentials: RequestCredentials;
  /** Address of a file beside it as it is fetched. */
  readonly partUrl: (url: string) => string;
}

/** The triangles of a glTF, as three.js has them. */
export class Model {
  readonly root: Group;
  readonly triangles: number;
  /** Bytes of geometry and textures. */
  readonly byteLength: number;
  /** In its own frame, y up. */
  readonly bounds: Bounds;
  /** Seconds of its longest animation; NaN without. */
  readonly duration: number;
  /** It brings lights of its own. */
  readonly hasLights: boolean;
  /** Grows when an animation has moved it. */
  version = 0;
  readonly #mixer: AnimationMixer | undefined;
  readonly #meshes: readonly Mesh[];

  private constructor(root: Group, animations: Awaited<ReturnType<GLTFLoader['parseAsync']>>['animations']) {
    this.root = root;
    const meshes: Mesh[] = [];
    let lights = 0;
    root.traverse((object) => {
      if (isMesh(object)) meshes.push(object);
      if ('isLight' in object) lights++;
    });
    this.#meshes = meshes;
    this.hasLights = lights > 0;
    this.triangles = meshes.reduce((sum, { geometry: { index, attributes } }) => {
      return sum + Math.floor((index ?? attributes.position)?.count / 3 || 0);
    }, 0);
    this.byteLength = this.#countBytes();
    this.bounds = boundsOf(root);
    this.duration = animations.length > 0 ? Math.max(...animations.map(({ duration }) => duration)) : NaN;
    if (animations.length === 0) return;
    this.#mixer = new AnimationMixer(root);
    for (const clip of animations) this.#mixer.clipAction(clip).play();
    // What bones move may be anywhere.
    for (const mesh of meshes) mesh.frustumCulled = false;
    this.setTime(0);
  }

  /**
   * Reads a glTF or GLB.
   * @throws GaussianSplatError `decode/*`
   */
  static async read(bytes: ArrayBuffer, { url, credentials, partUrl }: ModelRequest): Promise<Model> {
    const loader = new GLTFLoader(
      new LoadingManager().setURLModifier((part) => (/^(blob|data):/.test(part) ? part : partUrl(part))),
    );
    loader.setWithCredentials(credentials === 'include');
    loader.register((parser) => ({ name: 'without-splats', beforeRoot: () => prepare(loader, parser) }));
    try {
      const { scene, animations } = await loader.parseAsync(
        bytes,
        new URL('.', url.replace(/^blob:.*/, document.baseURI)).href,
      );
      return new Model(scene, animations);
    } catch (error) {
      if (error instanceof GaussianSplatError) throw error;
      throw unreadable(url, error);
    }
  }

  /** Moves what is animated to a time, in seconds. */
  setTime(seconds: number): void {
    if (this.#mixer === undefined) return;
    this.#mixer.setTime(Math.min(Math.max(0, seconds), this.duration - BEFORE_END));
    this.version++;
  }

  /** Calls back with each mesh and its materials. */
  forEachMesh(callback: (mesh: Mesh, materials: readonly Material[]) => void): void {
    for (const mesh of this.#meshes) callback(mesh, [mesh.material].flat());
  }

  get materials(): readonly Material[] {
    return this.#meshes.flatMap(({ material }) => material);
  }

  dispose(): void {
    this.#mixer?.stopAllAction();
    for (const { geometry } of this.#meshes) geometry.dispose();
    for (const material of this.materials) {
      for (const texture of texturesOf(material)) {
        texture.dispose();
        texture.image?.close?.();
      }
      material.dispose();
    }
  }

  #countBytes(): number {
    const geometries = new Set(this.#meshes.map(({ geometry }) => geometry));
    const textures = new Set(this.materials.flatMap(texturesOf));
    let bytes = 0;
    for (const { index, attributes } of geometries)
      for (const each of [index, ...Object.values(attributes)]) bytes += each?.array?.byteLength ?? 0;
    for (const { image } of textures) bytes += (image?.width ?? 0) * (image?.height ?? 0) * TEXEL_BYTES;
    return Math.round(bytes);
  }
}

const isMesh = (object: Object3D): object is Mesh => 'isMesh' in object;

const texturesOf = (material: Material): Texture[] =>
  Object.values(material).filter(
    (value): value is Texture => value !== null && typeof value === 'object' && 'isTexture' in value,
  );

/** Leaves out the primitives that hold splats, and fetches what compressed ones need. */
async function prepare(loader: GLTFLoader, { json }: GLTFParser): Promise<void> {
  for (const mesh of json.meshes ?? [])
    mesh.primitives = mesh.primitives.filter(({ extensions }) => !Object.hasOwn(extensions ?? {}, SPLATS));
  if (!json.extensionsUsed?.includes('EXT_meshopt_compression')) return;
  loader.setMeshoptDecoder(await loadMeshoptDecoder());
}

function boundsOf(root: Group): Bounds {
  root.updateMatrixWorld(true);
  const box = new Box3().setFromObject(root, true);
  if (box.isEmpty()) return { min: [0, 0, 0], max: [0, 0, 0], center: [0, 0, 0], radius: 1 };
  const [min, max] = [box.min, box.max].map(({ x, y, z }): Vector3 => [x, y, z]);
  const at = (axis: number): number => (min[axis] + max[axis]) / 2;
  const center: Vector3 = [at(0), at(1), at(2)];
  const radius = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) / 2 || 1;
  return { min, max, center, radius, subject: { center, radius } };
}

const unreadable = (where: string, cause: unknown): GaussianSplatError =>
  new GaussianSplatError('decode/corrupt', {
    where,
    expected: 'a glTF 2.0 or GLB file with triangles',
    found: cause instanceof Error ? cause.message : String(cause),
    remedy: 'open the file in a glTF validator; Draco and KTX2 are not read: meshopt and PNG, JPEG or WebP are',
    cause,
  });
