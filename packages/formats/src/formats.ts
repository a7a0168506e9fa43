import { startsWith } from './bytes.js';
import type { SceneFormat } from './scene-format.js';
import {
  isCompressedPly,
  isGltf,
  isGzip,
  isLodMeta,
  isNgsp,
  isPly,
  isSogMeta,
  isZip,
  looksLikeKsplat,
} from './signatures.js';

/** All formats that `readScene` reads; the first whose signature fits wins. */
export const sceneFormats: readonly SceneFormat[] = [
  {
    name: 'compressed-ply',
    readsPrefix: true,
    title: 'compressed PLY (PlayCanvas, SuperSplat)',
    extensions: ['.compressed.ply', '.ply'],
    mimeTypes: [],
    hasSignature: isCompressedPly,
    load: async () => (await import('./readers/compressed-ply.js')).readCompressedPly,
  },
  {
    name: 'ply',
    readsPrefix: true,
    title: 'PLY (INRIA 3D Gaussian Splatting)',
    extensions: ['.ply'],
    mimeTypes: ['model/ply', 'application/ply', 'application/x-ply'],
    hasSignature: isPly,
    load: async () => (await import('./readers/ply.js')).readPly,
  },
  {
    name: 'spz',
    readsPrefix: true,
    title: 'SPZ (Niantic)',
    extensions: ['.spz'],
    mimeTypes: ['model/spz', 'application/spz', 'application/x-spz'],
    // Versions 1 to 3 are gzip files; what else may be inside is the reader's to say.
    hasSignature: (bytes) => isNgsp(bytes) || isGzip(bytes),
    load: async () => (await import('./readers/spz.js')).readSpz,
  },
  {
    name: 'zip',
    title: 'ZIP archive of a scene (.sog bundles too)',
    extensions: ['.sog', '.zip'],
    mimeTypes: ['application/zip', 'application/x-zip-compressed'],
    hasSignature: isZip,
    load: async () => (await import('./readers/zip.js')).readZip,
  },
  {
    name: 'lod',
    title: 'streamed SOG (lod-meta.json)',
    extensions: ['.json'],
    mimeTypes: ['application/json'],
    hasSignature: isLodMeta,
    load: async () => (await import('./readers/lod.js')).readLod,
  },
  {
    name: 'sog',
    title: 'SOG (meta.json)',
    extensions: ['.json'],
    mimeTypes: ['application/json'],
    hasSignature: isSogMeta,
    load: async () => (await import('./readers/sog.js')).readSog,
  },
  {
    name: 'gltf',
    title: 'glTF with KHR_gaussian_splatting',
    extensions: ['.glb', '.gltf'],
    mimeTypes: ['model/gltf-binary', 'model/gltf+json'],
    hasSignature: (bytes) => startsWith(bytes, 'glTF') || isGltf(bytes),
    load: async () => (await import('./readers/gltf.js')).readGltf,
  },
  {
    name: 'ksplat',
    readsPrefix: true,
    title: '.ksplat (GaussianSplats3D)',
    extensions: ['.ksplat'],
    mimeTypes: [],
    hasSignature: looksLikeKsplat,
    isSignatureWeak: true,
    load: async () => (await import('./readers/ksplat.js')).readKsplat,
  },
  {
    name: 'splat',
    readsPrefix: true,
    title: '.splat (antimatter15)',
    extensions: ['.splat'],
    mimeTypes: ['model/splat', 'application/x-splat'],
    load: async () => (await import('./readers/splat.js')).readSplat,
  },
];

/** The format that the first bytes of a file prove; undefined where another than they must tell. */
export const signedFormat = (bytes: Uint8Array): SceneFormat | undefined =>
  sceneFormats.find(({ hasSignature }) => hasSignature?.(bytes));
