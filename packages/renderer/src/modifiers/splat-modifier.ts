import { inverse, multiply, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import { ModifierCut, Modifiers } from '../generated/modified-layouts.js';
import { constants } from '../generated/shaders.js';
import type { GaussianBlock, GaussianScene } from '../gaussian-scene.js';
import type { GeometryReading } from '../geometry-reading.js';
import { BUFFER_USAGE, type Resource } from '../gpu/kernel.js';
import { writeStruct } from '../gpu/struct.js';
import type { PlacementModifier } from '../placement-modifier.js';
import type { Placement } from '../world.js';
import { cutValues, directionIn, type SplatCut } from './cuts.js';
import { GroupTextures, noGroups, type SplatGroupIds } from './group-textures.js';
import type { SplatProgram } from './splat-program.js';
import type { SplatUniform } from './splat-shader.js';

/** Maximum number of cuts of one scene. */
export const MAX_CUTS: number = constants.MAX_CUTS;

/** Changes that a {@link SplatModifier} applies to the splats of a placement. */
export interface SplatChanges {
  /** Cuts of the scene, at most 16. Default: none. */
  readonly cuts?: readonly SplatCut[] | undefined;
  /** Scale of the scene about {@link center}: 1 shows the complete scene, 0 nothing. Default: 1. */
  readonly grown?: number | undefined;
  /** Fixed point of {@link grown} in world coordinates. Default: the origin. */
  readonly center?: Vector3 | undefined;
  /** Fraction of the splats that are drawn, 0 to 1. Drawn splats are enlarged to replace the others. Default: 1. */
  readonly share?: number | undefined;
  /** Values of the uniforms of the program's shader. Default: 0. */
  readonly uniforms?: Readonly<Record<string, SplatUniform>> | undefined;
  /** Time in seconds for the program's shader. Default: 0. */
  readonly time?: number | undefined;
  /** Row-major 4x4 rotation from world space to the space of the program's shader. Default: the identity. */
  readonly worldToViewer?: Matrix4 | undefined;
}

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Cuts, tints, reveals and moves the splats of one placement. A change writes a single uniform buffer. */
export class SplatModifier implements PlacementModifier {
  readonly #values: GPUBuffer;
  readonly program: SplatProgram;
  /** Changes whenever the effect of the modifier changes. */
  version = 0;
  readonly #device: GPUDevice;
  readonly #bytes = new ArrayBuffer(Modifiers.size);
  /** Words of the last written uniform. */
  readonly #written = new Uint32Array(Modifiers.size / 4);
  readonly #groups: GroupTextures | undefined;

  /** @param groups Groups of the splats of the scene; undefined if it has none. */
  constructor(device: GPUDevice, program: SplatProgram, groups?: SplatGroupIds) {
    this.#device = device;
    this.#groups = groups && new GroupTextures(device, groups);
    this.program = program;
    const { uniform, copyDestination } = BUFFER_USAGE;
    this.#values = device.createBuffer({
      label: 'gs.modifiers',
      size: Modifiers.size,
      usage: uniform | copyDestination,
    });
  }

  reading(kind?: GeometryReading): GeometryReading {
    return this.program.reading(kind);
  }

  resourcesOf(block: GaussianBlock, scene: GaussianScene): Readonly<Record<string, Resource>> {
    return { modifiers: this.#values, groups: this.#groups?.viewOf(block, scene) ?? noGroups(this.#device) };
  }

  /** Writes the changes for subsequent frames of a placement. @returns Whether they differ from the previous ones. */
  write(changes: SplatChanges, { scene, sceneToWorld = IDENTITY }: Placement): boolean {
    const { cuts = [], grown = 1, center = [0, 0, 0], share = 1, time = 0, uniforms = {}, worldToViewer } = changes;
    const [x, y, z] = scene.origin;
    const toWorld = multiply(sceneToWorld, [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1]);
    const toLocal = inverse(toWorld);
    const toViewer = worldToViewer ? multiply(worldToViewer, toWorld) : toWorld;
    const fromViewer = inverse(toViewer);
    const { shader } = this.program;
    const row = (k: number): Float64Array => toViewer.subarray(4 * k, 4 * k + 4);
    const column = (k: number): number[] => [fromViewer[k], fromViewer[4 + k], fromViewer[8 + k]];
    const used = cuts.filter((cut) => !cut.groups || this.#groups).slice(0, MAX_CUTS);
    const isRegrouped = this.#groups?.write(used) ?? false;
    const moves = grown < 1 || share < 1 || used.some(({ offset }) => offset?.some((by) => by !== 0));
    const moved = directionIn(toLocal, center).map((at, k) => at + toLocal[4 * k + 3]);
    const values = {
      ...{ to_viewer_x: row(0), to_viewer_y: row(1), to_viewer_z: row(2) },
      ...{ from_viewer_x: column(0), from_viewer_y: column(1), from_viewer_z: column(2) },
      ...{ cut_count: used.length, is_hooked: shader ? 1 : 0, time },
      ...{ center: moved, grown, share, moves: moves || (shader && shader.moves !== false) ? 1 : 0 },
      ...{ group_rows: this.#groups?.rows ?? 0, reserved: 0, cuts: [] },
      values: Object.keys(shader?.uniforms ?? {}).flatMap((name) => fourOf(uniforms[name] ?? shader!.uniforms![name])),
    };
    writeStruct(Modifiers, values, this.#bytes);
    const { offset } = Modifiers.fields.cuts;
    const { size } = ModifierCut;
    used.forEach((cut, k) =>
      writeStruct(ModifierCut, cutValues(cut, toWorld, toLocal), this.#bytes, offset + k * size),
    );
    const words = new Uint32Array(this.#bytes);
    const isSame = words.every((word, k) => word === this.#written[k]);
    if (isSame && !isRegrouped) return false;
    this.version++;
    if (isSame) return true;
    this.#written.set(words);
    this.#device.queue.writeBuffer(this.#values, 0, this.#bytes);
    return true;
  }

  destroy(): void {
    this.#values.destroy();
    this.#groups?.destroy();
  }
}

/** Returns a uniform as four numbers; missing and non-finite ones become 0. */
function fourOf(value: SplatUniform): number[] {
  const numbers = typeof value === 'number' ? [value] : value;
  return [0, 1, 2, 3].map((k) => (Number.isFinite(numbers[k]) ? numbers[k] : 0));
}
