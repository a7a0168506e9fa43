import * as modified from '../generated/modified-shaders.js';
import type { GeometryReading } from '../geometry-reading.js';
import { kernelOf, madeTogether, perDevice, type ShaderDescription } from '../gpu/kernel.js';
import type { GaussianScene } from '../gaussian-scene.js';
import { variantsOf } from '../variants.js';
import { hookText, requireCompiles, type SplatShader } from './splat-shader.js';

const PACKED: Required<GeometryReading> = {
  cullChunks: modified.cullChunksModified,
  cull: modified.cullModified,
  cullSerial: modified.cullSerialModified,
  project: modified.projectModified,
  pixelDepths: modified.pixelDepthsModified,
  probeSurface: modified.probeSurfaceModified,
};
const QUANTIZED: Required<GeometryReading> = {
  cullChunks: modified.cullChunksModified,
  cull: modified.cullQuantizedModified,
  cullSerial: modified.cullSerialQuantizedModified,
  project: modified.projectQuantizedModified,
  pixelDepths: modified.pixelDepthsQuantizedModified,
  probeSurface: modified.probeSurfaceQuantizedModified,
};

/** WGSL module that a hook replaces. The next line finds the name of its function. */
const HOOK = modified.sharedSplatHookPart;
const [, HOOK_NAME] = /\bfn (\w+)/.exec(HOOK)!;

/** Counter for unique names of shaders with a hook, because several may be compiled at the same time. */
let hooks = 0;

/**
 * Returns the programs of a device, keyed by the code of the hook with the types of its uniforms; '' without a hook.
 */
const programsOn = (device: GPUDevice): Map<string, SplatProgram> =>
  perDevice(device, 'splat programs', () => new Map<string, SplatProgram>());

/** Shaders that cut, reveal and move splats, with or without a hook. */
export class SplatProgram {
  readonly shader: SplatShader | undefined;
  readonly #device: GPUDevice;
  readonly #packed: Required<GeometryReading>;
  readonly #quantized: Required<GeometryReading>;

  private constructor(device: GPUDevice, shader: SplatShader | undefined, key: string) {
    this.#device = device;
    this.shader = shader;
    this.#packed = shader ? hooked(PACKED, shader, key) : PACKED;
    this.#quantized = shader ? hooked(QUANTIZED, shader, key) : QUANTIZED;
  }

  /**
   * Returns compiled shaders. They are compiled concurrently with frames, once for each hook and device.
   * @param scenes Scenes that are drawn with these shaders.
   * @throws GaussianSplatError `argument/splat-shader` for a hook that does not compile; `found` contains the line.
   */
  static async compile(
    device: GPUDevice,
    scenes: readonly GaussianScene[],
    shader?: SplatShader,
  ): Promise<SplatProgram> {
    const programs = programsOn(device);
    const text = shader ? hookText(shader, HOOK_NAME, modified.projectModified.code) : '';
    let program = programs.get(text);
    if (!program) {
      program = new SplatProgram(device, shader, `hook${hooks++}`);
      const { code } = program.#packed.project;
      if (shader) await requireCompiles(device, code, code.slice(0, code.indexOf(text)));
      programs.set(text, program);
    }
    await program.prepare(scenes);
    return program;
  }

  /** Returns the shaders that read a kind of geometry; default: `PackedGaussian`. */
  reading(kind?: GeometryReading): GeometryReading {
    return kind ? this.#quantized : this.#packed;
  }

  /** Compiles the missing pipelines for frames of these scenes, and resolves when all are compiled. */
  prepare(scenes: readonly GaussianScene[]): Promise<void> {
    const kinds = new Set(scenes.flatMap(({ blocks }) => blocks.map(({ reading }) => reading)));
    const { threads } = variantsOf(this.#device);
    return madeTogether(this.#device, () => {
      for (const kind of kinds) {
        const { cullChunks, cull, cullSerial, project } = this.reading(kind);
        for (const each of [cullChunks!, threads === 'serial' ? cullSerial : cull, project])
          kernelOf(this.#device, each);
      }
    });
  }
}

/** Returns the shaders of a kind of geometry with a hook. @param key Suffix of their names. */
function hooked(reading: Required<GeometryReading>, shader: SplatShader, key: string): Required<GeometryReading> {
  const withHook = <S extends ShaderDescription>(stage: S): S => {
    if (!stage.code.includes(HOOK)) return stage;
    const text = hookText(shader, HOOK_NAME, modified.projectModified.code);
    return { ...stage, name: `${stage.name}.${key}`, code: stage.code.replace(HOOK, () => text) };
  };
  const { cullChunks, cull, cullSerial, project, pixelDepths, probeSurface } = reading;
  return {
    cullChunks,
    cull: withHook(cull),
    cullSerial: withHook(cullSerial),
    project: withHook(project),
    pixelDepths: withHook(pixelDepths),
    probeSurface: withHook(probeSurface),
  };
}
