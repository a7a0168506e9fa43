import { startsWith } from './bytes.js';
import type { SceneFormat } from './scene-format.js';
import { isCompressedPly, isGltf, isGzip, isLodMeta, isNgsp, isPly, isSogMeta, isZip } from './signatures.js';

/** A format without its names. */
export type UsualFormat = Omit<SceneFormat, 'extensions' | 'mimeTypes'>;

/** The formats of most pages; the first matching signature wins. Those of late-formats.ts are loaded for other files. */
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
    // Versions 1 to 3 are gzip files; the reader checks their content.
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

/** Returns the common format whose signature the first bytes have; undefined for all others. */
export const signedFormat = (bytes: Uint8Array): UsualFormat | undefined =>
  usualFormats.find(({ hasSignature }) => hasSignature?.(bytes));
