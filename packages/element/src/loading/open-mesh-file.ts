/** Reads triangle meshes. The worker loads this module for the first mesh. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { fileRequest } from '@gaussian-splat/core/fetch';
import {
  fetchScene,
  Ktx2Decoder,
  LoadBudget,
  readTriangles,
  type ImageFile,
  type TriangleFile,
} from '@gaussian-splat/formats';
import { fileLimits, fileName, limitsFrom, named, throttled } from './load-scene.js';
import { ProgressSum } from './progress-sum.js';
import type { FileRequest, TaskListeners } from './protocol.js';

/** The validated triangles of a file, and its decoded images. */
export interface LoadedMesh extends Omit<TriangleFile, 'images'> {
  /** Images of the file, by their index; undefined for unused ones. */
  readonly images: readonly (ImageBitmap | undefined)[];
}

/**
 * Fetches a glTF and the files that it names, checks their memory costs, and decodes the images. Throws
 * GaussianSplatError (`network/*`, `decode/*`, `out-of-memory/*`), or the signal's reason if that is aborted.
 */
export async function openMeshFile(
  request: FileRequest,
  signal: AbortSignal,
  { onProgress }: Pick<TaskListeners, 'onProgress'>,
): Promise<LoadedMesh> {
  const { url, credentials } = request;
  const name = fileName(url);
  const limits = limitsFrom(request);
  try {
    const progress = new ProgressSum(throttled(onProgress), /\.gltf$/i.test(name));
    const fetch = (part: Pick<FileRequest, 'url' | 'credentials'>): Promise<Uint8Array> =>
      fetchScene(part.url, {
        ...{ mode: 'cors', credentials: part.credentials, signal, onProgress: progress.add() },
        ...fileLimits(limits()),
      });
    const bytes = await fetch({ url, credentials });
    const budget = new LoadBudget(bytes.length, limits());
    const openUri = async (uri: string): Promise<Uint8Array> => {
      budget.request(name);
      const part = await fetch(fileRequest(uri, { url, credentials }, request.limits?.origins));
      budget.arrive(part.length);
      return part;
    };
    const file = await readTriangles({ bytes, name, budget, openUri });
    signal.throwIfAborted();
    return await withBitmaps(file, { name, budget }, signal);
  } catch (error) {
    signal.throwIfAborted();
    throw named(error, name);
  }
}

async function withBitmaps(
  file: TriangleFile,
  { name, budget }: { readonly name: string; readonly budget: LoadBudget },
  signal: AbortSignal,
): Promise<LoadedMesh> {
  const ktx2 = new Ktx2Decoder(budget);
  const bitmaps: (ImageBitmap | undefined)[] = [];
  try {
    for (const [index, image] of file.images.entries()) {
      bitmaps.push(image && (await decoded(image, `${name}, images[${index}]`, ktx2)));
      signal.throwIfAborted();
    }
  } catch (error) {
    for (const bitmap of bitmaps) bitmap?.close();
    throw error;
  }
  return { ...file, images: bitmaps };
}

/**
 * Decodes an image to the values of its file, without a color profile, as `GLTFLoader` of three.js does. Throws
 * GaussianSplatError `decode/corrupt` if it cannot be decoded, or its size differs from its header.
 */
async function decoded(image: ImageFile, where: string, ktx2: Ktx2Decoder): Promise<ImageBitmap> {
  const { bytes, type, width, height } = image;
  const fail = (found: string, cause?: unknown): never => {
    throw new GaussianSplatError('decode/corrupt', {
      where,
      expected: `an image of ${width} x ${height} pixels, as its header says`,
      found,
      remedy: 'export the file again; the image is damaged',
      cause,
    });
  };
  const options: ImageBitmapOptions = { premultiplyAlpha: 'none', colorSpaceConversion: 'none' };
  const content =
    type === 'image/ktx2' ? new ImageData(await ktx2.decode(image, where), width, height) : new Blob([bytes], { type });
  const bitmap = await createImageBitmap(content, options).catch((cause: unknown) =>
    fail((cause as Error).message, cause),
  );
  // The orientation in the metadata of a JPEG may exchange the sides.
  if (
    Math.max(bitmap.width, bitmap.height) === Math.max(width, height) &&
    bitmap.width * bitmap.height === width * height
  )
    return bitmap;
  const found = `${bitmap.width} x ${bitmap.height}`;
  bitmap.close();
  return fail(found);
}
