import { GaussianSplatError } from '@gaussian-splat/core';
import type { AccumulationFormat, RasterizerName } from './rasterizers/rasterizer.js';
import type { Threads } from './stages/stage.js';

/**
 * Everything that trades accuracy for speed, one setting each. docs/frontier has what each costs and saves.
 */
export interface RenderSettings {
  /**
   * How splats become pixels: `quads` by the GPU's own rasterizer and blending, `tiles` by compute shaders, front to back
   * in float32 and with an end where nothing behind can be seen. `auto`: see {@link autotune}.
   */
  readonly rasterizer: 'auto' | RasterizerName;
  /** How stages share their work; the image is the same. `auto`: see {@link autotune}. */
  readonly threads: 'auto' | Threads;
  /**
   * Precision in which quads are blended and images kept. `auto`: see {@link autotune}. `rgba32float` takes twice the memory and bandwidth, and quads then need the
   * feature `float32-blendable`.
   */
  readonly accumulation: 'auto' | AccumulationFormat;
  /**
   * Bits of the keys that splats are sorted by. 32 are those of the float32 depth and sort exactly; fewer
   * are spread over the logarithm of the visible depths.
   */
  readonly depthKeyBits: 16 | 24 | 32;
  /**
   * Submissions that the painting of a frame is divided into, at least: the image is the same, but none runs as long, which matters where drivers stop what takes
   * them too long. Frames of tiles that may have much to do are divided further without being asked. 1 to 256.
   */
  readonly submissions: number;
  /**
   * Where tiles end a pixel. Up to 1e-4, which scenes are trained with: before the splat that would leave it this transmittance or less. Above: behind that splat.
   */
  readonly transmittanceMin: number;
  /**
   * What splats are ordered by: `center`, the depth of their centres, as most scenes are trained; `distance`, that of their centres from the eye, which turning the
   * camera does not change (frames with other depths take `center`); or `pixel`, at each pixel where along its ray a splat is
   * densest. That does not pop when the camera turns, is what scenes of StopThePop and its successors are trained with, and takes the rasterizer `tiles`.
   * Its code is loaded with the first frame that asks for it: until then splats are ordered by `center`.
   */
  readonly order: 'center' | 'pixel' | 'distance';
  /** With `order: 'pixel'`: splats of a pixel that are sorted at once. One that is listed later than that is blended late. */
  readonly orderWindow: 16 | 32;
  /** Spherical harmonics above this degree are ignored. */
  readonly shDegree: 0 | 1 | 2 | 3;
  /**
   * Scenes with levels of detail (`packWithDetail`, streamed scenes): pixels by which nearly all that is drawn (two standard deviations) may be displaced for
   * having been merged, before finer splats are drawn instead. 0, the default, draws the finest there are. 0 to 64.
   */
  readonly detail: number;
  /** Octaves of distance over which one level of detail fades into the next; with 0 they pop. 0 to 2. */
  readonly detailFade: number;
  /**
   * Scenes with levels of detail: most splats that a frame looks at; `detail` grows as far as that takes. 0 for no limit.
   */
  readonly splatBudget: number;
  /** Share of the target's width and height that is really drawn; the rest is interpolated. Above 0, at most 1. */
  readonly resolutionScale: number;
}

/** The threshold of the trainers: INRIA's, gsplat's. */
export const TRAINED_TRANSMITTANCE = 1e-4;

/** The settings that leave nothing out: what scenes were trained with. */
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

/** A named mix of settings: see {@link QUALITIES}. */
export type Quality = 'reference' | 'default' | 'balanced' | 'fast';

/**
 * What each quality means. The figures are the least PSNR against the float64 reference image that each is held to, on scenes of any kind (captured, opaque, faint, thin; `npm test -- qualities`):
 * `reference` 75 dB, `default` 59 dB (no error survives the rounding to 8 bits), `balanced` 42 dB, `fast` 36 dB; captured scenes keep 50 and 44 dB with the last two.
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
 * The settings that frames may set otherwise than those before and behind them at no cost. The others decide what a viewpoint allocates.
 */
export type PerFrameSettings = Pick<
  RenderSettings,
  'depthKeyBits' | 'transmittanceMin' | 'order' | 'orderWindow' | 'shDegree' | 'detail' | 'resolutionScale'
>;

const RANGES: Readonly<Partial<Record<keyof RenderSettings, readonly [least: number, most: number]>>> = {
  submissions: [1, 256],
  transmittanceMin: [0, 1],
  detail: [0, 64],
  detailFade: [0, 2],
  splatBudget: [0, 2 ** 31],
  resolutionScale: [1 / 64, 1],
};

/** The values of settings that are no range. */
const CHOICES: Readonly<Partial<Record<keyof RenderSettings, readonly unknown[]>>> = {
  rasterizer: ['auto', 'quads', 'tiles'],
  threads: ['auto', 'parallel', 'serial'],
  accumulation: ['auto', 'rgba16float', 'rgba32float'],
  depthKeyBits: [16, 24, 32],
  order: ['center', 'pixel', 'distance'],
  orderWindow: [16, 32],
  shDegree: [0, 1, 2, 3],
};

/** The settings of a quality, with those that differ from it. */
export function completed(options: SomeSettings): RenderSettings {
  const base = QUALITIES[options.quality ?? 'default'];
  const names = Object.keys(base) as (keyof RenderSettings)[];
  return Object.fromEntries(names.map((name) => [name, options[name] ?? base[name]])) as unknown as RenderSettings;
}

/**
 * The same, checked.
 * @throws GaussianSplatError `argument/value` for a number out of range, a name that its setting does not know or an unknown quality.
 */
export function renderSettingsOf(options: SomeSettings): RenderSettings {
  const quality = options.quality ?? 'default';
  if (!Object.hasOwn(QUALITIES, quality)) throw invalid('quality', Object.keys(QUALITIES).join(', '), quality);
  const levers = completed(options);
  for (const name of Object.keys(levers) as (keyof RenderSettings)[]) requireInRange(name, levers[name]);
  if (levers.order === 'pixel' && levers.rasterizer === 'quads') {
    throw invalid('order', "'center' with the rasterizer quads: 'pixel' takes tiles", 'pixel');
  }
  return levers;
}

/** @throws GaussianSplatError `argument/value` for a value that is not in the range of its setting or none of its choices. */
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
