import { foreignName } from './foreign-signatures.js';
import { loadDiagnosis } from './load-parts.js';

/**
 * A file that a scene names, unless it is what servers send in place of one that is missing: a page, or the pointer of a file that git LFS never fetched.
 * @param name what error messages call it
 * @throws GaussianSplatError `decode/html`, `decode/lfs-pointer`
 */
export async function checkedPart(bytes: Uint8Array, name: string): Promise<Uint8Array> {
  if (!/^(html|lfsPointer)$/.test(foreignName(bytes) ?? '')) return bytes;
  const { diagnose } = await loadDiagnosis();
  throw diagnose(bytes, name, '', 'the file that the scene names');
}
