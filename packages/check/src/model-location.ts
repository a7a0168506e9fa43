import { readFile } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { GaussianSplatError } from '@gaussian-splat/core';
import { partUrl } from '@gaussian-splat/core/fetch';
import { sidecarName } from '@gaussian-splat/core/contract';
import { openUrl, type ByteSource, type ExternalFile, type UrlSource } from '@gaussian-splat/core/onnx';
import { externalSizes, FileSource } from './file-source.js';

/** A model on disk or on a server, with its companion files. */
export interface ModelLocation {
  readonly source: ByteSource;
  /** Text of the contract beside the model; undefined if there is none. */
  sidecar(): Promise<string | undefined>;
  /** Sizes of external files, if they are known without a download. */
  externalSizes(files: readonly ExternalFile[]): Promise<ReadonlyMap<string, number> | undefined>;
  /** The whole model. */
  bytes(): Promise<Uint8Array>;
  /** A whole file beside the model. */
  external(location: string): Promise<Uint8Array>;
  close(): Promise<void>;
}

/** @param model A path, or an address that begins with http: or https:. */
export function openModel(model: string): Promise<ModelLocation> {
  return /^https?:\/\//i.test(model) ? openRemote(model) : openLocal(model);
}

async function openLocal(path: string): Promise<ModelLocation> {
  const source = await FileSource.open(path).catch((cause: unknown) => {
    throw unreadable(path, cause);
  });
  return {
    source,
    sidecar: () => readTextIfThere(sidecarName(path)),
    externalSizes: (files) => externalSizes(path, files),
    bytes: () => readFile(path),
    external: (location) => readFile(join(dirname(path), location)),
    close: () => source.close(),
  };
}

async function openRemote(url: string): Promise<ModelLocation> {
  const source = await openUrl(url);
  const whole = (file: UrlSource): Promise<Uint8Array> => file.read(0, file.size);
  return {
    source,
    sidecar: () => fetchTextIfThere(sidecarName(url)),
    externalSizes: () => Promise.resolve(undefined),
    bytes: async () => source.whole ?? whole(await openUrl(url, { maxRequests: 1, chunk: source.size })),
    external: async (location) => whole(await openUrl(partUrl(location, url), { maxRequests: 1 })),
    close: () => Promise.resolve(),
  };
}

/** Returns the text of a file that the user names. @throws GaussianSplatError if it cannot be read. */
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

/** Many servers respond to unknown paths with their own page, which is not a sidecar. */
async function fetchTextIfThere(url: string): Promise<string | undefined> {
  const text = await readText(url).catch((error: unknown) => {
    if (error instanceof GaussianSplatError && error.code === 'network/status') return undefined;
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
