import { startsWith } from './bytes.js';
import type { SceneFormat } from './scene-format.js';
import { isCompressedPly, isGltf, isGzip, isLodMeta, isNgsp, isPly, isSogMeta, isZip } from './signatures.js';

/** A scene format without its extensions and media types. */
export type UsualFormat = Omit<SceneFormat, 'extensions' | 'mimeTypes'>;

/** Formats of most pages; the first matching signature applies. The other formats, in late-formats.ts, are loaded late. */
export const usualFormats: readonly UsualFormat[] = [
  {
    name: 'compressed-ply',
    readsPrefix: true,
    title: 'compressed PLY (PlayCanvas, SuperSplat)',
    hasSignature: isCompressedPly,
    load: async () => (await import('./readers/compressed-ply.js')).readCompressedPly,
  },
  {
    name: 'ply',
    readsPrefix: true,
    title: 'PLY (INRIA 3D Gaussian Splatting)',
    hasSignature: isPly,
    load: async () => (await import('./readers/ply.js')).readPly,
  },
  {
    name: 'spz',
    readsPrefix: true,
    title: 'SPZ (Niantic)',
    // SPZ of versions 1 to 3 is a gzip file. The reader checks its inflated content.
    hasSignature: (bytes) => isNgsp(bytes) || isGzip(bytes),
    load: async () => (await import('./readers/spz.js')).readSpz,
  },
  {
    name: 'zip',
    title: 'ZIP archive of a scene (.sog bundles too)',
    hasSignature: isZip,
    load: async () => (await import('./readers/zip.js')).readZip,
  },
  {
    name: 'lod',
    title: 'streamed SOG (lod-meta.json)',
    hasSignature: isLodMeta,
    load: async () => (await import('./readers/lod.js')).readLod,
  },
  {
    name: 'sog',
    title: 'SOG (meta.json)',
    hasSignature: isSogMeta,
    load: async () => (await import('./readers/sog.js')).readSog,
  },
  {
    name: 'gltf',
    title: 'glTF with KHR_gaussian_splatting',
    hasSignature: (bytes) => startsWith(bytes, 'glTF') || isGltf(bytes),
    load: async () => (await import('./readers/gltf.js')).readGltf,
  },
];

/** Returns the first of {@link usualFormats} whose signature a file has; undefined for all other files. */
export const signedFormat = (bytes: Uint8Array): UsualFormat | undefined =>
  usualFormats.find(({ hasSignature }) => hasSignature?.(bytes));
