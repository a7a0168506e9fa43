import { asciiOf, isJsonObject, startsWith } from './bytes.js';
import { MAX_HEADER_BYTES, USUAL_HEADER_BYTES } from './ply/header-bytes.js';
import { looksLikeKsplat } from './ksplat/signature.js';
import type { SceneFormat } from './scene-format.js';

/** Text that tells a compressed PLY from a plain one; it stands within the first lines of every such header. */
const COMPRESSED_PLY_MARK = /[\r\n]property[ \t]+\S+[ \t]+packed_position\s/;

const isPly = (bytes: Uint8Array): boolean => /^(\u00ef\u00bb\u00bf)?ply[ \t]*[\r\n]/.test(asciiOf(bytes, 0, 16));
const isCompressedPly = (bytes: Uint8Array): boolean => {
  if (!isPly(bytes)) return false;
  const [header, isWhole] = [asciiOf(bytes, 0, USUAL_HEADER_BYTES), /[\r\n]end_header\s/];
  return COMPRESSED_PLY_MARK.test(isWhole.test(header) ? header : asciiOf(bytes, 0, MAX_HEADER_BYTES));
};
/** With the only method there is, and no flag that has no meaning: a `.splat` may begin with the first two bytes. */
const isGzip = (bytes: Uint8Array): boolean => startsWith(bytes, [0x1f, 0x8b, 8]) && (bytes[3] & 0xe0) === 0;
/** A description in JSON with a key that no other has. Keys come in any order, and one may have megabytes (buffers of glTF), so the samples are long and of both ends. */
const isJsonWith =
  (key: RegExp) =>
  (bytes: Uint8Array): boolean =>
    isJsonObject(bytes) && key.test(asciiOf(bytes, 0, USUAL_HEADER_BYTES) + asciiOf(bytes, -USUAL_HEADER_BYTES));
const isLodMeta = isJsonWith(/"(lodLevels|filenames)"\s*:/);
const isSogMeta = isJsonWith(/"means"\s*:/);
const isGltf = isJsonWith(/"(asset|bufferViews)"\s*:\s*[[{]/);
/** A file; none; and volumes of which this is the only one. */
const ZIP_STARTS = ['PK\x03\x04', 'PK\x05\x06', 'PK00PK\x03\x04', 'PK\x07\x08PK\x03\x04'];
const isNgsp = (bytes: Uint8Array): boolean => startsWith(bytes, 'NGSP');

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
    hasSignature: (bytes) => ZIP_STARTS.some((start) => startsWith(bytes, start)),
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
