import { startsWith } from './bytes.js';
import type { SceneFormat } from './scene-format.js';
import { isCompressedPly, isGltf, isGzip, isLodMeta, isNgsp, isPly, isSogMeta, isZip } from './signatures.js';

/** What is known of a format without its names. */
export type UsualFormat = Omit<SceneFormat, 'extensions' | 'mimeTypes'>;

/** The formats that most pages have; the first whose signature fits wins. Those of late-formats.ts are loaded for files that are none of them. */
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
    // Versions 1 to 3 are gzip files; what else may be inside is the reader's to say.
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

/** The usual format that the first bytes of a file prove; undefined for all others. */
export const signedFormat = (bytes: Uint8Array): UsualFormat | undefined =>
  usualFormats.find(({ hasSignature }) => hasSignature?.(bytes));
