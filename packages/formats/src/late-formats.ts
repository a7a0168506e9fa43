/** Rare formats, and extensions and media types of all formats. Loaded for files without a common signature. */
import { startsWith } from './bytes.js';
import { usualFormats } from './formats.js';
import type { SceneFormat } from './scene-format.js';
import { isJsonWith, isRad, looksLikeKsplat } from './signatures.js';

const lateFormats: readonly SceneFormat[] = [
  {
    name: 'rad',
    title: 'RAD (Spark)',
    extensions: ['.rad', '.radc'],
    mimeTypes: [],
    hasSignature: isRad,
    load: async () => (await import('./readers/rad.js')).readRad,
  },
  {
    name: 'lcc',
    title: 'LCC (XGRIDS)',
    extensions: ['.lcc'],
    mimeTypes: [],
    hasSignature: isJsonWith(/"totalLevel"\s*:/),
    load: async () => (await import('./readers/lcc.js')).readLcc,
  },
  {
    name: 'lcc2',
    title: 'LCC2 (XGRIDS)',
    extensions: ['.lcc2'],
    mimeTypes: [],
    hasSignature: isJsonWith(/"(totalLevels|lod_3dgs_info)"\s*:/),
    load: async () => (await import('./readers/lcc2.js')).readLcc2,
  },
  {
    name: 'usd',
    title: 'OpenUSD (.usda, .usdc)',
    extensions: ['.usd', '.usda', '.usdc'],
    mimeTypes: ['model/vnd.usda'],
    hasSignature: (bytes) => startsWith(bytes, 'PXR-USDC') || startsWith(bytes, '#usda '),
    load: async () => (await import('./readers/usd.js')).readUsd,
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

/** Extensions and media types of the common formats, for files whose content has no signature. */
const NAMES: Partial<Record<SceneFormat['name'], Pick<SceneFormat, 'extensions' | 'mimeTypes'>>> = {
  'compressed-ply': { extensions: ['.compressed.ply', '.ply'], mimeTypes: [] },
  ply: { extensions: ['.ply'], mimeTypes: ['model/ply', 'application/ply', 'application/x-ply'] },
  spz: { extensions: ['.spz'], mimeTypes: ['model/spz', 'application/spz', 'application/x-spz'] },
  zip: {
    extensions: ['.sog', '.zip', '.usdz'],
    mimeTypes: ['application/zip', 'application/x-zip-compressed', 'model/vnd.usdz+zip'],
  },
  lod: { extensions: ['.json'], mimeTypes: ['application/json'] },
  sog: { extensions: ['.json'], mimeTypes: ['application/json'] },
  gltf: { extensions: ['.glb', '.gltf'], mimeTypes: ['model/gltf-binary', 'model/gltf+json'] },
};

/** All formats that `readScene` supports; the first matching signature applies. */
export const sceneFormats: readonly SceneFormat[] = [
  ...usualFormats.map((format) => ({ extensions: [], mimeTypes: [], ...NAMES[format.name], ...format })),
  ...lateFormats,
];
