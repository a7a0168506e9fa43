/** The pages of a streamed scene as shaders/page_feedback.wgsl sees them: what doing without each costs a view. */
import { eyeOf, type Camera, type Vector3 } from '@gaussian-splat/core';
import type { DetailManifest } from '@gaussian-splat/renderer';
import { DETAIL_NUMBERS, DETAIL_PLACES, listPages, NONE } from '@gaussian-splat/renderer/stages';

type PageList = ReturnType<typeof listPages>;

/** Numbers of a `Chunk`, and the reach among them. */
const [CHUNK_NUMBERS, REACH] = [8, 3];
/** As the constants of the shader. */
const [NEARBY, NEARBY_SIZE, UNSEEN] = [1 / 4, 2, 1 / 16];

/** The chunk above each page. */
export class FlightPages {
  readonly list: PageList;
  /** [P, 4] sphere. */
  readonly #spheres: Float64Array;
  readonly #errors: Float64Array;
  /** [P, 7] center and half size of the box, reach. */
  readonly #boxes: Float64Array;

  /** @param fileOf gets a file's name, returns its bytes */
  constructor(manifest: DetailManifest, fileOf: (file: string) => ArrayBuffer) {
    this.list = listPages(manifest);
    const { count, parent, parentChunk } = this.list;
    this.#spheres = new Float64Array(4 * count);
    this.#errors = new Float64Array(count);
    this.#boxes = new Float64Array(7 * count);
    for (let page = 0; page < count; page++) {
      if (parent[page] === NONE) continue;
      const { file, first } = this.list.place(parent[page]);
      const [x, y, z] = this.list.translate(parent[page]);
      const numbers = new Float32Array(fileOf(file.file));
      const chunk = first + parentChunk[page];
      const row = CHUNK_NUMBERS * file.chunks + DETAIL_NUMBERS * chunk;
      const sphere = row + DETAIL_PLACES.sphere;
      const place = [x, y, z, 0].map((shift, k) => numbers[sphere + k] + shift);
      this.#spheres.set(place, 4 * page);
      this.#errors[page] = numbers[row + DETAIL_PLACES.fullError];
      const box = CHUNK_NUMBERS * chunk;
      [x, y, z].forEach((shift, axis) => {
        const [low, high] = [numbers[box + axis], numbers[box + 4 + axis]];
        this.#boxes[7 * page + axis] = (low + high) / 2 + shift;
        this.#boxes[7 * page + 3 + axis] = (high - low) / 2;
      });
      this.#boxes[7 * page + 6] = numbers[box + REACH];
    }
  }

  /**
   * Pixels that doing without each page costs a view, those out of view a part of it.
   * @param max gets a page and its pixels, of those that cost more than `allowed`
   */
  request(camera: Camera, allowed: number, max: (page: number, pixels: number, isVisible: boolean) => void): void {
    const focal = Math.max(camera.fx, camera.fy);
    const [ex, ey, ez] = eyeOf(camera.worldToCamera);
    const sides = sidesOf(camera);
    const nearby = sidesOf(widened(camera));
    const spheres = this.#spheres;
    for (let page = 1; page < this.list.count; page++) {
      const [dx, dy, dz] = [spheres[4 * page] - ex, spheres[4 * page + 1] - ey, spheres[4 * page + 2] - ez];
      const distance = Math.max(Math.sqrt(dx * dx + dy * dy + dz * dz) - spheres[4 * page + 3], camera.near);
      const pixels = (focal * this.#errors[page]) / distance;
      if (pixels <= allowed) continue;
      const isVisible = this.#mayBeVisible(page, sides);
      const share = isVisible ? 1 : this.#mayBeVisible(page, nearby) ? NEARBY : UNSEEN;
      max(page, share * pixels, isVisible);
    }
  }

  #mayBeVisible(page: number, sides: readonly Side[]): boolean {
    const at = 7 * page;
    const box = this.#boxes;
    for (const { normal, shift, reach } of sides) {
      let min = shift - reach * box[at + 6];
      for (let axis = 0; axis < 3; axis++) {
        min += normal[axis] * box[at + axis] - Math.abs(normal[axis]) * box[at + 3 + axis];
      }
      if (min > 0) return false;
    }
    return true;
  }
}

/** A box is beyond a side of the view if normal · p + shift is more than reach times its splats' for all of its points. */
interface Side {
  readonly normal: Vector3;
  readonly shift: number;
  readonly reach: number;
}

function widened(camera: Camera): Camera {
  const [width, height] = [NEARBY_SIZE * camera.width, NEARBY_SIZE * camera.height];
  return {
    ...camera,
    width,
    height,
    cx: camera.cx + (width - camera.width) / 2,
    cy: camera.cy + (height - camera.height) / 2,
  };
}

function sidesOf({ fx, fy, cx, cy, width, height, near, worldToCamera: m }: Camera): Side[] {
  const margin = 3;
  const tangent = Math.max((0.65 * width) / fx, (0.65 * height) / fy);
  const reach = Math.sqrt(1 + tangent * tangent);
  const side = (x: number, y: number, z: number, own: number, offset = 0): Side => ({
    normal: [0, 1, 2].map((k) => x * m[k] + y * m[4 + k] + z * m[8 + k]) as unknown as Vector3,
    shift: x * m[3] + y * m[7] + z * m[11] + offset,
    reach: own,
  });
  return [
    side(0, 0, -1, 0, near),
    side(fx, 0, cx - width - margin, fx * reach),
    side(-fx, 0, -cx - margin, fx * reach),
    side(0, fy, cy - height - margin, fy * reach),
    side(0, -fy, -cy - margin, fy * reach),
  ];
}
