import { GaussianSplatError, type Bounds, type Vector3 } from '@gaussian-splat/core';
import type { Reservation } from '@gaussian-splat/renderer/tools';
import type { LoadedMesh } from '../../loading/open-mesh-file.js';
import {
  AnimationMixer,
  Box3,
  type BufferGeometry,
  GLTFLoader,
  type GLTFParser,
  type Group,
  type Material,
  type Mesh,
  type Object3D,
  Sphere,
  Texture,
  type Vector3 as Vector,
} from './three.js';

/** Seconds before the end at which an animation stops, because at the end itself it restarts. */
const BEFORE_END = 1e-4;
/** Largest coordinate that bounds contain, as for splats. */
const FARTHEST = 1e18;

/** Triangles, lines and points of a glTF file as objects of three.js. */
export class Model {
  readonly root: Group;
  readonly triangles: number;
  /** Bytes of GPU memory of geometry and textures. */
  readonly byteLength: number;
  /** Bounds in the model's own coordinates, y up. */
  readonly bounds: Bounds;
  /** Duration of the longest animation, seconds; NaN without animations. */
  readonly duration: number;
  /** Whether the file contains lights. */
  readonly hasLights: boolean;
  /** Incremented when an animation has moved the model. */
  version = 0;
  readonly #mixer: AnimationMixer | undefined;
  readonly #meshes: readonly Mesh[];
  readonly #reservation: Reservation;

  private constructor(
    { scene: root, animations }: Awaited<ReturnType<GLTFLoader['parseAsync']>>,
    reservation: Reservation,
  ) {
    this.root = root;
    this.#reservation = reservation;
    const meshes: Mesh[] = [];
    let lights = 0;
    root.traverse((object) => {
      if (isMesh(object)) meshes.push(closed(object));
      if ('isLight' in object) lights++;
    });
    this.#meshes = meshes;
    for (const { geometry } of meshes) bound(geometry);
    this.hasLights = lights > 0;
    this.triangles = meshes.reduce((sum, { geometry: { index, attributes } }) => {
      return sum + Math.floor((index ?? attributes.position)?.count / 3 || 0);
    }, 0);
    this.byteLength = reservation.bytes;
    this.bounds = boundsOf(root);
    this.duration = animations.length > 0 ? Math.max(...animations.map(({ duration }) => duration)) : NaN;
    if (animations.length === 0) return;
    this.#mixer = new AnimationMixer(root);
    for (const clip of animations) this.#mixer.clipAction(clip).play();
    // Meshes are not culled, because skinning may move them out of their bounds.
    this.setCulling(false);
    this.setTime(0);
  }

  /**
   * Creates the objects of a validated file. The loader of three.js finds all buffer views and images in its cache, so
   * that it fetches nothing.
   * @param url Address for messages.
   * @param reservation GPU memory of the model, released with the model or when this call rejects.
   * @throws GaussianSplatError `decode/*`
   */
  static async read(mesh: LoadedMesh, url: string, reservation: Reservation): Promise<Model> {
    try {
      const loader = new GLTFLoader();
      loader.register((parser) => ({ name: 'checked', beforeRoot: () => fill(parser, mesh) }));
      // The type of the first parameter is the bytes of a file, but the loader accepts parsed JSON as well.
      return new Model(await loader.parseAsync(mesh.json, ''), reservation);
    } catch (error) {
      reservation.release();
      throw error instanceof GaussianSplatError ? error : unreadable(url, error);
    }
  }

  /** Sets all animations to a time in seconds, clamped to the duration. */
  setTime(seconds: number): void {
    if (this.#mixer === undefined) return;
    this.#mixer.setTime(Math.min(Math.max(0, seconds), this.duration - BEFORE_END));
    // three.js computes the bounds of a skinned mesh at its first ray cast, for the pose of that time.
    for (const mesh of this.#meshes) if (mesh.boundingSphere) mesh.boundingSphere = null;
    this.version++;
  }

  /** Sets whether meshes outside the camera's view are culled. @returns the previous setting */
  setCulling(isOn: boolean): boolean {
    const wasOn = this.#meshes.some(({ frustumCulled }) => frustumCulled);
    for (const mesh of this.#meshes) mesh.frustumCulled = isOn;
    return wasOn;
  }

  /** Calls a function with each mesh and its materials. */
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
    this.#reservation.release();
  }
}

/** Converts a `LineLoop`, which the renderer of three.js cannot draw, to a line whose last index is the first one. */
function closed(mesh: Mesh): Mesh {
  if (!mesh.isLineLoop) return mesh;
  mesh.isLineLoop = false;
  const { index, attributes } = mesh.geometry;
  const indices = index?.array
    ? Array.from(index.array)
    : Array.from({ length: attributes.position.count }, (_, i) => i);
  mesh.geometry.setIndex(indices.concat(indices.slice(0, 1)));
  return mesh;
}

const isMesh = (object: Object3D): object is Mesh => 'geometry' in object;

const texturesOf = (material: Material): Texture[] =>
  Object.values(material).filter(
    (value): value is Texture => value !== null && typeof value === 'object' && 'isTexture' in value,
  );

/** Puts the buffer views and images of a file into the cache that the loader reads before it fetches. */
async function fill(
  { cache, sourceCache }: GLTFParser,
  { views, images }: Pick<LoadedMesh, 'views' | 'images'>,
): Promise<void> {
  for (const [index, view] of views.entries()) if (view) cache.add(`bufferView:${index}`, Promise.resolve(view.buffer));
  for (const [index, image] of images.entries()) {
    if (!image) continue;
    const texture = new Texture(image);
    texture.needsUpdate = true;
    sourceCache[index] = Promise.resolve(texture);
  }
}

/** Bounds without the points that cannot be drawn: NaN, infinities, and coordinates beyond {@link FARTHEST}. */
class DrawableBox extends Box3 {
  override expandByPoint(point: Vector): this {
    return isNear(point) ? super.expandByPoint(point) : this;
  }

  override union(box: Box3): this {
    return isNear(box.min) && isNear(box.max) ? super.union(box) : this;
  }
}

const isNear = ({ x, y, z }: Vector): boolean =>
  Math.abs(x) <= FARTHEST && Math.abs(y) <= FARTHEST && Math.abs(z) <= FARTHEST;

/** Computes the bounds of a geometry, because those that a file states may be wrong. */
function bound(geometry: BufferGeometry): void {
  const box = new DrawableBox().setFromBufferAttribute(geometry.attributes.position);
  // Morph targets may leave the box: three.js computes their bounds.
  const isMorphed = geometry.morphAttributes.position !== undefined;
  geometry.boundingBox = isMorphed ? null : box;
  geometry.boundingSphere = isMorphed ? null : box.getBoundingSphere(new Sphere());
}

function boundsOf(root: Group): Bounds {
  root.updateMatrixWorld(true);
  const box = new DrawableBox().setFromObject(root, true);
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
    remedy: 'open the file in a glTF validator',
    cause,
  });
