/** Scenes of the studio: trained from path traced images, with their references. tests/fixtures/studio/README.md says how they are made. */
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { fileURLToPath } from 'node:url';
import { gunzipSync } from 'node:zlib';
import {
  cameraFromCalibration,
  type CalibratedView,
  type Camera,
  type GaussianCloud,
  type Vector3,
} from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';

const TRUTHS = fileURLToPath(new URL('../fixtures/studio/', import.meta.url));
const SCENES = fileURLToPath(new URL('../../demo/scenes/studio/', import.meta.url));

/** All scenes that are in the repository. */
export const STUDIO = ['apartment', 'garden', 'hall', 'product', 'walker'] as const;
export type StudioName = (typeof STUDIO)[number];

/** A rectangle of the floor: smallest and largest x, smallest and largest z. */
export type Rectangle = readonly [number, number, number, number];

/** References of a scene: meters, x right, y down, z forward. */
export interface StudioTruth {
  readonly up: Vector3;
  readonly floors: readonly { readonly x0x1z0z1: Rectangle; readonly y: number }[];
  /** Floor that furniture stands on. */
  readonly taken: readonly Rectangle[];
  /** Square meters of floor that nothing stands on. */
  readonly freeFloor: number;
  readonly lengths: readonly {
    readonly name: string;
    readonly from: Vector3;
    readonly to: Vector3;
    readonly meters: number;
  }[];
  /** Names of objects; their indices are the ids of {@link StudioScene.depths}. */
  readonly objects: readonly string[];
  readonly depth: {
    readonly everyPixel: number;
    readonly unit: number;
    readonly shape: readonly [number, number, number];
  };
  readonly training: { readonly images: number; readonly antialiased: boolean };
  /** PSNR in dB against held-out images, by the trainer: mean, and each. */
  readonly measured: {
    readonly psnr: number;
    readonly ssim: number;
    readonly splats: number;
    readonly each: readonly number[];
  };
}

/** A camera and the name of its image. */
export interface StudioView {
  readonly name: string;
  readonly camera: Camera;
}

/** Ends of the rays through every {@link StudioTruth.depth}.everyPixel-th pixel, row by row. */
export interface StudioDepths {
  readonly width: number;
  readonly height: number;
  /** Meters along the optical axis; 0 where there is nothing. */
  readonly depths: Float32Array;
  /** Indices of objects; 255 where there is nothing. */
  readonly ids: Uint8Array;
  /** Pixel of a value: its column and row in the image, at the pixel's middle. */
  readonly pixel: (index: number) => { readonly x: number; readonly y: number };
}

export interface StudioScene {
  readonly name: StudioName;
  readonly file: string;
  readonly cloud: GaussianCloud;
  readonly truth: StudioTruth;
  /** Views of images that the scene was not trained on. */
  readonly held: readonly StudioView[];
  /** The image of a view: [height, width, 3], 0 to 1. */
  image(view: StudioView): Promise<Float32Array>;
  /** Depth and ids of a held-out view. */
  depths(view: StudioView): StudioDepths;
}

const jsonOf = <T>(path: string): T => JSON.parse(readFileSync(path, 'utf8')) as T;

/** Reads a scene of the studio and its truth. */
export async function studio(name: StudioName): Promise<StudioScene> {
  const folder = `${TRUTHS}${name}/`;
  const file = `${SCENES}${name}.spz`;
  const truth = jsonOf<StudioTruth>(`${folder}truth.json`);
  const { views } = jsonOf<{ views: (CalibratedView & { name: string })[] }>(`${folder}views.json`);
  const held = views.map((view) => ({
    name: view.name,
    camera: cameraFromCalibration({ ...view, near: 0.05 }, `${name} ${view.name}`),
  }));
  const known = new Map<number, StudioDepths>();
  return {
    name,
    file,
    truth,
    held,
    cloud: await readScene(new Uint8Array(readFileSync(file)), { name: `${name}.spz` }),
    image: (view) => imageOf(`${folder}images/${view.name}.webp`),
    depths: (view) => {
      const index = held.indexOf(view);
      if (!known.has(index)) known.set(index, depthsOf(`${folder}depth.bin.gz`, truth, index));
      return known.get(index)!;
    },
  };
}

function depthsOf(path: string, { depth: { shape, unit, everyPixel } }: StudioTruth, index: number): StudioDepths {
  const [count, height, width] = shape;
  if (index < 0 || index >= count) throw new RangeError(`a view with depths: 0 to ${count - 1}, not ${index}`);
  const bytes = gunzipSync(readFileSync(path));
  const [all, pixels] = [count * height * width, height * width];
  const codes = new Uint16Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + 2 * all));
  const offset = everyPixel / 2 + 0.5;
  return {
    width,
    height,
    depths: Float32Array.from(codes.subarray(index * pixels, (index + 1) * pixels), (code) => code * unit),
    ids: Uint8Array.from(bytes.subarray(2 * all + index * pixels, 2 * all + (index + 1) * pixels)),
    pixel: (i) => ({ x: (i % width) * everyPixel + offset, y: Math.floor(i / width) * everyPixel + offset }),
  };
}

let decoding: Promise<(file: ArrayBuffer) => Promise<ImageData>> | undefined;

/** libwebp of the command's package: Node has no decoder of its own. */
function decoder(): Promise<(file: ArrayBuffer) => Promise<ImageData>> {
  return (decoding ??= (async () => {
    globalThis.ImageData ??= function (data: Uint8ClampedArray, width: number, height: number) {
      return { data, width, height };
    } as unknown as typeof ImageData;
    const { default: decode, init } = await import('@jsquash/webp/decode.js');
    const path = createRequire(import.meta.url).resolve('@jsquash/webp/codec/dec/webp_dec.wasm');
    await init(new WebAssembly.Module(readFileSync(path)));
    return decode;
  })());
}

async function imageOf(path: string): Promise<Float32Array> {
  const bytes = readFileSync(path);
  const { data } = await (await decoder())(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
  const pixels = new Float32Array((3 * data.length) / 4);
  for (let i = 0; i < pixels.length; i++) pixels[i] = data[4 * Math.floor(i / 3) + (i % 3)] / 255;
  return pixels;
}
