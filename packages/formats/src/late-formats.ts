/** Rare formats, and formats that are recognized by their names: loaded for files without a common signature. */
import { usualFormats } from './formats.js';
import type { SceneFormat } from './scene-format.js';
import { isRad, looksLikeKsplat } from './signatures.js';

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

/** Names of the common formats, which are recognized by their content. */
const NAMES: Partial<Record<SceneFormat['name'], Pick<SceneFormat, 'extensions' | 'mimeTypes'>>> = {
  'compressed-ply': { extensions: ['.compressed.ply', '.ply'], mimeTypes: [] },
  ply: { extensions: ['.ply'], mimeTypes: ['model/ply', 'application/ply', 'application/x-ply'] },
  spz: { extensions: ['.spz'], mimeTypes: ['model/spz', 'application/spz', 'application/x-spz'] },
  zip: { extensions: ['.sog', '.zip'], mimeTypes: ['application/zip', 'application/x-zip-compressed'] },
  lod: { extensions: ['.json'], mimeTypes: ['application/json'] },
  sog: { extensions: ['.json'], mimeTypes: ['application/json'] },
  gltf: { extensions: ['.glb', '.gltf'], mimeTypes: ['model/gltf-binary', 'model/gltf+json'] },
};

/** All formats of `readScene`; the first matching signature wins. */
export const sceneFormats: readonly SceneFormat[] = [
  ...usualFormats.map((format) => ({ extensions: [], mimeTypes: [], ...NAMES[format.name], ...format })),
  ...lateFormats,
];
