/** The kinds of sources. No other file decides whether a request is for a generator, a stream or a file. */
import { loadModule } from '@gaussian-splat/core';
import type { LoadedGaussians } from '../gpu/loaded-gaussians.js';
import type { DeviceLease } from '../gpu/shared-device.js';
import type { LoadedSequence, SceneRequest } from '../loading/protocol.js';
import { open } from './file/open-file.js';
import { nameIn } from './name-in.js';
import type { OpenOptions, SourceKind } from './source-kind.js';

/** All kinds of sources. A source is of the first kind that matches its request. */
const SOURCE_KINDS: readonly SourceKind[] = [
  { name: 'splats', matches: ({ splats }) => splats, load: () => import('./splats/open-splats.js') },
  { name: 'mesh', matches: ({ isMesh }) => isMesh, load: () => import('./mesh/open-mesh.js') },
  {
    name: 'generator',
    matches: ({ url, contract }) => contract || /\.onnx$/i.test(nameIn(url)),
    load: () => import('./generator/open-dynamic-model.js'),
  },
  {
    name: 'clip',
    matches: ({ url }) => /\.(gsv|4dgs)$/i.test(nameIn(url)),
    load: () => import('./clip/clip-player.js'),
  },
  {
    // A `detail.json`; or a `lod-meta.json`, a tileset, LCC, LCC2 or RAD, unless the request is for its finest level, complete.
    name: 'stream',
    matches: ({ url, isWhole }) =>
      (isWhole ? /(^|\/)detail\.json$/i : /(^|\/)(detail|lod-meta|tileset)\.json$|\.(lcc2?|rad)$/i).test(nameIn(url)),
    load: () => import('./stream/open-streamed.js'),
  },
  // The manifest of a sequence may have any name.
  { name: 'sequence', matches: (_, found) => found, load: () => import('./sequence/sequence-player.js') },
  { name: 'file', matches: () => true, load: async () => ({ open }) },
];

/**
 * Returns the kind of a requested source.
 * @param found Manifest that the file of the request turned out to be; absent before it is read.
 */
export const kindOf = (request: SceneRequest, found?: LoadedSequence): SourceKind =>
  SOURCE_KINDS.find((kind) => kind.matches(request, found))!;

/**
 * Opens a source with WebGPU. The result owns the lease of the device. Rejects with GaussianSplatError, or with the
 * signal's reason; the caller then releases the lease.
 * @param acquiring Resolves with the device, which is requested while the bytes are in transit.
 * @param found Manifest that the file of the request turned out to be; absent before it is read.
 */
export async function openSource(
  request: SceneRequest,
  options: OpenOptions,
  acquiring: Promise<DeviceLease>,
  found?: LoadedSequence,
): Promise<LoadedGaussians> {
  const { name, load } = kindOf(request, found);
  const code = await loadModule(`the code that opens a ${name}`, load);
  const opened = await code.open(request, options, acquiring, found);
  return 'frames' in opened ? openSource(request, options, acquiring, opened) : opened;
}
