import { open, stat, type FileHandle } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { isInside } from '@gaussian-splat/core/contract';
import type { ByteSource, ExternalFile } from '@gaussian-splat/core/onnx';

/** A file on disk, read in ranges. */
export class FileSource implements ByteSource {
  readonly name: string;
  readonly size: number;
  readonly chunk = 65_536;
  readonly #handle: FileHandle;

  private constructor(name: string, size: number, handle: FileHandle) {
    this.name = name;
    this.size = size;
    this.#handle = handle;
  }

  /** @throws the error of `node:fs` if the file cannot be opened. */
  static async open(path: string): Promise<FileSource> {
    const handle = await open(path);
    const status = await handle.stat();
    if (status.isFile()) return new FileSource(path, status.size, handle);
    await handle.close();
    throw Object.assign(new Error(`EISDIR: ${path} is no file`), { code: 'EISDIR', syscall: 'open' });
  }

  async read(offset: number, length: number): Promise<Uint8Array> {
    const { buffer, bytesRead } = await this.#handle.read(new Uint8Array(length), 0, length, offset);
    return buffer.subarray(0, bytesRead);
  }

  close(): Promise<void> {
    return this.#handle.close();
  }
}

/** Returns the sizes of a model's external files, by their location in the model. */
export async function externalSizes(model: string, files: readonly ExternalFile[]): Promise<Map<string, number>> {
  const sizes = new Map<string, number>();
  for (const { location } of files) {
    const status = isInside(location) ? await stat(join(dirname(model), location)).catch(() => undefined) : undefined;
    if (status?.isFile()) sizes.set(location, status.size);
  }
  return sizes;
}
