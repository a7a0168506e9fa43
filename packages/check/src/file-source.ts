import { open, stat, type FileHandle } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { isInside } from '@gaussian-splat/core/contract';
import type { ByteSource, ExternalFile } from '@gaussian-splat/core/onnx';

/** Maximum bytes of one read. Node refuses to read 2 GiB at once, which weights beside a model may exceed. */
const MAX_READ = 2 ** 30;

/** A file on disk that is read in ranges of bytes. */
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

  /** Opens a file. @throws the error of `node:fs` if it cannot be opened, or one with the code EISDIR for a folder */
  static async open(path: string): Promise<FileSource> {
    const handle = await open(path);
    const status = await handle.stat();
    if (status.isFile()) return new FileSource(path, status.size, handle);
    await handle.close();
    throw Object.assign(new Error(`EISDIR: ${path} is not a file`), { code: 'EISDIR', syscall: 'open' });
  }

  async read(offset: number, length: number): Promise<Uint8Array> {
    const bytes = new Uint8Array(length);
    let done = 0;
    while (done < length) {
      const { bytesRead } = await this.#handle.read(bytes, done, Math.min(MAX_READ, length - done), offset + done);
      if (bytesRead === 0) break;
      done += bytesRead;
    }
    return bytes.subarray(0, done);
  }

  close(): Promise<void> {
    return this.#handle.close();
  }
}

/**
 * Returns the sizes of a model's external files in bytes, by their location in the model. Files that are missing or
 * outside the model's folder are left out.
 */
export async function externalSizes(model: string, files: readonly ExternalFile[]): Promise<Map<string, number>> {
  const sizes = new Map<string, number>();
  for (const { location } of files) {
    const status = isInside(location) ? await stat(join(dirname(model), location)).catch(() => undefined) : undefined;
    if (status?.isFile()) sizes.set(location, status.size);
  }
  return sizes;
}
