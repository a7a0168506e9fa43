import { GaussianSplatError } from '@gaussian-splat/core';
import type { AccumulationFormat, RasterizerName } from './rasterizers/rasterizer.js';
import type { Threads } from './stages/stage.js';

/** Settings that trade accuracy for speed. docs/frontier shows the cost and the saving of each. */
export interface RenderSettings {
  /**
   * Rasterizer: `quads` uses hardware rasterization and blending, `tiles` uses compute shaders, front to back in
   * float32, which stop when nothing behind is visible. `auto`: see {@link autotune}.
   */
  readonly rasterizer: 'auto' | RasterizerName;
  /** Workgroup variant of the stages; the image is the same. `auto`: see {@link autotune}. */
  readonly threads: 'auto' | Threads;
  /**
   * Precision of blending quads and of storing images. `auto`: see {@link autotune}. `rgba32float` takes twice the
   * memory and bandwidth, and quads then need the feature `float32-blendable`.
   */
  readonly accumulation: 'auto' | AccumulationFormat;
  /**
   * Bits of the sort keys. 32 are those of the float32 depth and sort exactly; fewer are distributed over the logarithm
   * of the visible depth range.
   */
  readonly depthKeyBits: 16 | 24 | 32;
  /**
   * Lower limit of the submissions into which the rasterization of a frame is divided. The image is the same, but each
   * one is shorter, because some drivers stop long ones. Expensive frames of tiles are divided further automatically. 1
   * to 256.
   */
  readonly submissions: number;
  /**
   * Transmittance that ends a pixel of tiles. Up to 1e-4, as in training: before the splat that would reduce it to this
   * value or less. Above: after that splat.
   */
  readonly transmittanceMin: number;
  /**
   * Sort order of splats. `center`: depth of their centers, as most scenes are trained. `distance`: distance of their
   * centers from the eye, which does not change when the camera rotates (frames with mesh depth use `center`). `pixel`:
   * for each pixel the densest depth along its ray. It does not pop when the camera rotates, matches scenes of
   * StopThePop and its successors, and requires the rasterizer `tiles`. Its code is loaded with the first frame that
   * requests it: until then splats are sorted by `center`.
   */
  readonly order: 'center' | 'pixel' | 'distance';
  /**
   * For `order: 'pixel'`: size of the sorted window of a pixel. A splat that is listed later than that is blended late.
   */
  readonly orderWindow: 16 | 32;
  /** Maximum degree of spherical harmonics; higher ones are ignored. */
  readonly shDegree: 0 | 1 | 2 | 3;
  /**
   * Scenes with levels of detail (`packWithDetail`, streamed scenes): allowed displacement in pixels, which nearly all
   * merged splats (two standard deviations) keep, before finer splats are drawn. 0, the default, draws the finest
   * level. 0 to 64.
   */
  readonly detail: number;
  /** Octaves of distance over which one level of detail fades into the next; 0 switches abruptly. 0 to 2. */
  readonly detailFade: number;
  /** Scenes with levels of detail: upper limit of the splats in a frame; `lodError` grows as required. 0 for no limit. */
  readonly splatBudget: number;
  /** Fraction of the target's width and height that is rendered; the result is upsampled. Above 0, at most 1. */
  readonly resolutionScale: number;
}

/** Threshold of the trainers: INRIA's and gsplat's. */
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
 * Settings of each quality. The figures are the minimum PSNR against the float64 reference image that tests enforce on
 * scenes of any kind (captured, opaque, faint, thin; `npm test -- qualities`): `reference` 75 dB, `default` 59 dB (no
 * error survives the rounding to 8 bits), `balanced` 42 dB, `fast` 36 dB; captured scenes keep 50 and 44 dB with the
 * last two.
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

/** Settings that may differ from frame to frame at no cost. The others determine the allocations of a viewpoint. */
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

/** Values of settings that are not a range. */
const CHOICES: Readonly<Partial<Record<keyof RenderSettings, readonly unknown[]>>> = {
  rasterizer: ['auto', 'quads', 'tiles'],
  threads: ['auto', 'parallel', 'serial'],
  accumulation: ['auto', 'rgba16float', 'rgba32float'],
  depthKeyBits: [16, 24, 32],
  order: ['center', 'pixel', 'distance'],
  orderWindow: [16, 32],
  shDegree: [0, 1, 2, 3],
};

/** Completes partial settings with those of a quality. */
export function completed(options: SomeSettings): RenderSettings {
  const base = QUALITIES[options.quality ?? 'default'];
  const names = Object.keys(base) as (keyof RenderSettings)[];
  return Object.fromEntries(names.map((name) => [name, options[name] ?? base[name]])) as unknown as RenderSettings;
}

/**
 * The same, validated.
 * @throws GaussianSplatError `argument/value` for a number out of range, a value that its setting does not accept or an
 * unknown quality.
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

/** @throws GaussianSplatError `argument/value` for a value that its setting does not accept. */
export function requireInRange(name: keyof RenderSettings, found: unknown, where = 'FrameSettings'): void {
  const choices = CHOICES[name];
  if (choices && !choices.includes(found)) throw invalid(name, choices.join(', '), found, where);
  const range = RANGES[name];
  if (range === undefined) return;
  const value = Number(found);
  if (!(value >= range[0] && value <= range[1])) {
    throw invalid(name, `a number from ${range[0]} to ${range[1]}`, found, where);
  }
}

function invalid(name: string, expected: string, found: unknown, where = 'FrameSettings'): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: `${where}.${name}`,
    expected,
    found: String(found),
    remedy: 'leave the option out for the default, or choose one of the values expected',
  });
}
