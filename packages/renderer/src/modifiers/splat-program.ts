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

/** The part that a page's function takes the place of, and its name there. */
const HOOK = modified.sharedSplatHookPart;
const [, HOOK_NAME] = /\bfn (\w+)/.exec(HOOK)!;

/** Of the names of shaders with a function in them: several may be compiled at a time. */
let hooks = 0;

/** Programs of a device by the code of the page's function and the types of its uniforms; '' for none. */
const programsOn = (device: GPUDevice): Map<string, SplatProgram> =>
  perDevice(device, 'splat programs', () => new Map<string, SplatProgram>());

/** Shaders that cut, reveal and move splats, with a page's own function or without one. */
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
   * Compiles the shaders beside the frames, or finds those that are there.
   * @param scenes that they are for
   * @throws GaussianSplatError `argument/splat-shader` for a function that does not compile: `found` names the line
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

  /** The shaders that read geometry of a kind. */
  reading(kind?: GeometryReading): GeometryReading {
    return kind ? this.#quantized : this.#packed;
  }

  /** Makes the pipelines that frames of these scenes need, unless they are there. */
  prepare(scenes: readonly GaussianScene[]): Promise<void> {
    const kinds = new Set(scenes.flatMap(({ pages }) => pages.map(({ reading }) => reading)));
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

/** A page's function in the shaders of a reading. */
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
