import { GaussianSplatError } from '@gaussian-splat/core';
import type { AccumulationFormat, RasterizerName } from './rasterizers/rasterizer.js';
import type { Threads } from './stages/stage.js';

/** Settings that trade accuracy for speed. docs/frontier shows the cost and the savings of each setting. */
export interface RenderSettings {
  /**
   * Rasterizer. `quads` uses hardware rasterization and blending. `tiles` uses compute shaders that blend front to back
   * in float32, and stop when nothing behind is visible. `auto`: see {@link autotune}.
   */
  readonly rasterizer: 'auto' | RasterizerName;
  /** Workgroup variant of the stages; the image is the same. `auto`: see {@link autotune}. */
  readonly threads: 'auto' | Threads;
  /**
   * Precision of blending with `quads`, and of stored images. `auto`: see {@link autotune}. `rgba32float` takes twice
   * the memory and bandwidth, and requires the feature `float32-blendable` for `quads`.
   */
  readonly accumulation: 'auto' | AccumulationFormat;
  /**
   * Bits of the sort keys. 32 bits are the float32 depth, and sort exactly. Fewer bits are distributed over the
   * logarithm of the visible depth range.
   */
  readonly depthKeyBits: 16 | 24 | 32;
  /**
   * Minimum number of submissions into which the rasterization of a frame is divided, 1 to 256. The image is the same,
   * but each submission is shorter, because some drivers stop long ones. Expensive frames of `tiles` are divided
   * further automatically.
   */
  readonly submissions: number;
  /**
   * Transmittance that ends a pixel of `tiles`. Values up to 1e-4 end it before the splat that would reduce the
   * transmittance to the value or less, as in training. Larger values end it after that splat.
   */
  readonly transmittanceMin: number;
  /**
   * Sort order of splats. `center`: depth of their centers, as most scenes are trained. `distance`: distance of their
   * centers from the eye, which does not change when the camera rotates (frames with mesh depth use `center`). `pixel`:
   * densest depth along the ray of each pixel. This order does not pop when the camera rotates, matches scenes of
   * StopThePop and its successors, and requires the rasterizer `tiles`. Its code is loaded with the first frame that
   * requests it; until then splats are sorted by `center`.
   */
  readonly order: 'center' | 'pixel' | 'distance';
  /**
   * For `order: 'pixel'`: number of splats that a pixel holds in order to sort them. Splats arrive in a coarser order. A
   * splat that arrives more than this number of places after its correct place is blended too late.
   */
  readonly orderWindow: 16 | 32;
  /** Maximum degree of spherical harmonics; higher ones are ignored. */
  readonly shDegree: 0 | 1 | 2 | 3;
  /**
   * Scenes with levels of detail (`packWithDetail`, streamed scenes): allowed displacement in pixels, 0 to 64. Nearly
   * all merged splats (two standard deviations) stay within this displacement; otherwise finer splats are drawn. 0, the
   * default, draws the finest level.
   */
  readonly detail: number;
  /** Octaves of distance over which one level of detail fades into the next; 0 switches abruptly. 0 to 2. */
  readonly detailFade: number;
  /**
   * Scenes with levels of detail: maximum number of splats in a frame. The error threshold of `detail` grows as
   * required. 0 for no limit.
   */
  readonly splatBudget: number;
  /** Fraction of the target's width and height that is rendered, above 0 and at most 1. The result is upsampled. */
  readonly resolutionScale: number;
}

/** Transmittance that ends blending in the trainers of INRIA and gsplat. */
export const TRAINED_TRANSMITTANCE = 1e-4;

/** The exact settings, as in training. */
const EXACT: RenderSettings = {
  rasterizer: 'auto',
  threads: 'auto',
  accumulation: 'auto',
  depthKeyBits: 24,
  submissions: 1,
  transmittanceMin: TRAINED_TRANSMITTANCE,
  order: 'center',
  orderWindow: 16,
  shDegree: 3,
  detail: 0,
  detailFade: 0.5,
  splatBudget: 0,
  resolutionScale: 1,
};

type SomeSettings = Partial<RenderSettings> & { readonly quality?: Quality };

/** A named set of settings: see {@link QUALITIES}. */
export type Quality = 'reference' | 'default' | 'balanced' | 'fast';

/**
 * Settings of each quality. Tests (`npm test -- qualities`) enforce a minimum PSNR against the float64 reference image:
 * `reference` 75 dB, `default` 59 dB (no error survives the rounding to 8 bits), `balanced` 42 dB, `fast` 36 dB. Captured
 * scenes reach at least 50 dB with `balanced` and 44 dB with `fast`. Stress scenes (opaque or faint splats) test only
 * these two; with `quads`, against the image of `default`.
 */
export const QUALITIES: Readonly<Record<Quality, RenderSettings>> = {
  reference: {
    ...EXACT,
    rasterizer: 'tiles',
    accumulation: 'rgba32float',
  },
  default: EXACT,
  balanced: {
    ...EXACT,
    depthKeyBits: 16,
    transmittanceMin: 1 / 256,
  },
  fast: {
    ...EXACT,
    depthKeyBits: 16,
    transmittanceMin: 1 / 128,
  },
};

/**
 * Settings that may change from frame to frame at no cost. The other settings determine the allocations of a viewpoint.
 */
export type PerFrameSettings = Pick<
  RenderSettings,
  'depthKeyBits' | 'transmittanceMin' | 'order' | 'orderWindow' | 'shDegree' | 'detail' | 'resolutionScale'
>;

const RANGES: Readonly<Partial<Record<keyof RenderSettings, readonly [min: number, max: number]>>> = {
  submissions: [1, 256],
  transmittanceMin: [0, 1],
  detail: [0, 64],
  detailFade: [0, 2],
  splatBudget: [0, 2 ** 31],
  resolutionScale: [1 / 64, 1],
};

/** Accepted values of the settings that have no range. */
const CHOICES: Readonly<Partial<Record<keyof RenderSettings, readonly unknown[]>>> = {
  rasterizer: ['auto', 'quads', 'tiles'],
  threads: ['auto', 'parallel', 'serial'],
  accumulation: ['auto', 'rgba16float', 'rgba32float'],
  depthKeyBits: [16, 24, 32],
  order: ['center', 'pixel', 'distance'],
  orderWindow: [16, 32],
  shDegree: [0, 1, 2, 3],
};

/** Returns all settings: missing ones are those of the quality. Values are not checked. */
export function completed(options: SomeSettings): RenderSettings {
  const base = QUALITIES[options.quality ?? 'default'];
  const names = Object.keys(base) as (keyof RenderSettings)[];
  return Object.fromEntries(names.map((name) => [name, options[name] ?? base[name]])) as unknown as RenderSettings;
}

/**
 * Returns all settings: missing ones are those of the quality. Values are checked.
 * @throws GaussianSplatError `argument/value` for a number out of range, a value that its setting does not accept, or
 * an unknown quality.
 */
export function renderSettingsOf(options: SomeSettings): RenderSettings {
  const quality = options.quality ?? 'default';
  if (!Object.hasOwn(QUALITIES, quality)) throw invalid('quality', Object.keys(QUALITIES).join(', '), quality);
  const settings = completed(options);
  for (const name of Object.keys(settings) as (keyof RenderSettings)[]) requireInRange(name, settings[name]);
  if (settings.order === 'pixel' && settings.rasterizer === 'quads') {
    throw invalid('order', "'center' with the rasterizer quads: 'pixel' takes tiles", 'pixel');
  }
  return settings;
}

/**
 * Checks the value of a setting.
 * @throws GaussianSplatError `argument/value` for a value that the setting does not accept.
 */
export function requireInRange(name: keyof RenderSettings, found: unknown): void {
  const choices = CHOICES[name];
  if (choices && !choices.includes(found)) throw invalid(name, choices.join(', '), found);
  const range = RANGES[name];
  if (range === undefined) return;
  const value = Number(found);
  if (!(value >= range[0] && value <= range[1])) {
    throw invalid(name, `a number from ${range[0]} to ${range[1]}`, found);
  }
}

function invalid(name: string, expected: string, found: unknown): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: `FrameSettings.${name}`,
    expected,
    found: String(found),
    remedy: 'leave the option out for the default, or choose one of the values expected',
  });
}
