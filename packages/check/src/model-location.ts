import { readFile } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { GaussianSplatError } from '@gaussian-splat/core';
import { sidecarName, sidecarPath } from '@gaussian-splat/core/contract';
import { externalUrl, openUrl, type ByteSource, type ExternalFile } from '@gaussian-splat/core/onnx';
import { externalSizes, FileSource } from './file-source.js';

/** A model on disk or on a server, with its companion files. */
export interface ModelLocation {
  readonly source: ByteSource;
  /** Returns the text of the contract next to the model; undefined if there is none. */
  sidecar(): Promise<string | undefined>;
  /** Returns the sizes of external files in bytes, by location; undefined if they are unknown without a download. */
  externalSizes(files: readonly ExternalFile[]): Promise<ReadonlyMap<string, number> | undefined>;
  /** Returns the bytes of the whole model. */
  bytes(): Promise<Uint8Array>;
  /** Returns the bytes of an external file. */
  external(location: string): Promise<Uint8Array>;
  close(): Promise<void>;
}

/**
 * Opens a model.
 * @param model Path, or URL that begins with http: or https:.
 * @throws GaussianSplatError if the model cannot be read
 */
export function openModel(model: string): Promise<ModelLocation> {
  return /^https?:\/\//i.test(model) ? openRemote(model) : openLocal(model);
}

const whole = (file: ByteSource): Promise<Uint8Array> => file.read(0, file.size);

function openFile(path: string): Promise<FileSource> {
  return FileSource.open(path).catch((cause: unknown) => {
    throw unreadable(path, cause);
  });
}

async function openLocal(path: string): Promise<ModelLocation> {
  const source = await openFile(path);
  return {
    source,
    sidecar: () => readTextIfThere(sidecarPath(path)),
    externalSizes: (files) => externalSizes(path, files),
    bytes: () => whole(source),
    external: async (location) => {
      const file = await openFile(join(dirname(path), location));
      return whole(file).finally(() => file.close());
    },
    close: () => source.close(),
  };
}

async function openRemote(url: string): Promise<ModelLocation> {
  const source = await openUrl(url);
  return {
    source,
    sidecar: () => fetchTextIfThere(sidecarName(url)),
    externalSizes: () => Promise.resolve(undefined),
    bytes: async () => source.whole ?? whole(await openUrl(url, { maxRequests: 1, chunk: source.size })),
    external: async (location) => whole(await openUrl(externalUrl(location, url)!, { maxRequests: 1 })),
    close: () => Promise.resolve(),
  };
}

/** Returns the text of a file whose path or URL the user has given. @throws GaussianSplatError if it cannot be read */
export async function readText(path: string): Promise<string> {
  if (/^https?:\/\//i.test(path)) {
    const source = await openUrl(path);
    return new TextDecoder().decode(await source.read(0, source.size));
  }
  return readFile(path, 'utf8').catch((cause: unknown) => {
    throw unreadable(path, cause);
  });
}

async function readTextIfThere(path: string): Promise<string | undefined> {
  return readFile(path, 'utf8').catch((error: NodeJS.ErrnoException) => {
    if (error.code === 'ENOENT') return undefined;
    throw unreadable(path, error);
  });
}

/**
 * Returns the text at a URL; undefined if there is none. Many servers respond to unknown paths with an HTML page, which
 * does not count as text.
 */
async function fetchTextIfThere(url: string): Promise<string | undefined> {
  const text = await readText(url).catch((error: unknown) => {
    // A server that is busy or fails may have the file.
    const isFailing = /HTTP status (429|5\d\d)/.test((error as Error).message);
    if (error instanceof GaussianSplatError && error.code === 'network/status' && !isFailing) return undefined;
    throw error;
  });
  return text === undefined || /^\s*</.test(text) ? undefined : text;
}

function unreadable(path: string, cause: unknown): GaussianSplatError {
  return new GaussianSplatError('argument/value', {
    where: path,
    expected: 'a file that can be read',
    found: (cause as Error).message,
    remedy: 'check the path',
    cause,
  });
}
