/** The kinds of sources. No other file decides whether a request is for a generator, a stream or a file. */
import { loadModule } from '@gaussian-splat/core';
import type { LoadedSequence, SceneRequest } from '../loading/protocol.js';
import { openFile } from './file/open-file.js';
import type { SourceKind } from './source-kind.js';

/** Returns a function that loads code, and opens a source with it. */
const late =
  <Code>(purpose: string, load: () => Promise<Code>, openOf: (code: Code) => SourceKind['open']): SourceKind['open'] =>
  async (...asked) =>
    openOf(await loadModule(purpose, load))(...asked);

/** All kinds of sources. A source is of the first kind that matches its request. */
const SOURCE_KINDS: readonly SourceKind[] = [
  {
    name: 'mesh',
    matches: ({ isMesh }) => isMesh === true,
    open: late(
      'the code that shows meshes',
      () => import('./mesh/open-mesh.js'),
      ({ openMesh }) => openMesh,
    ),
  },
  {
    name: 'generator',
    matches: ({ url, contract }) => !isEmpty(contract) || /\.onnx$/i.test(nameIn(url)),
    open: late(
      'the code that runs generators',
      () => import('./generator/open-dynamic-model.js'),
      (code) => code.openDynamicScene,
    ),
  },
  {
    name: 'clip',
    matches: ({ url }) => /\.(gsv|4dgs)$/i.test(nameIn(url)),
    open: late(
      'the code that plays clips',
      () => import('./clip/clip-player.js'),
      ({ openClip }) => openClip,
    ),
  },
  {
    // A `detail.json`, or a `lod-meta.json`, unless the request is for its finest level, complete.
    name: 'stream',
    matches: ({ url, isWhole }) => {
      const name = /(^|\/)(detail|lod-meta)\.json$/i.exec(nameIn(url));
      return name !== null && !(isWhole && name[2] === 'lod-meta');
    },
    open: late(
      'the code that streams scenes',
      () => import('./stream/open-streamed.js'),
      (code) => code.openStreamedScene,
    ),
  },
  {
    // Its manifest may have any name.
    name: 'sequence',
    matches: (_, found) => found !== undefined,
    open: late(
      'the code that plays sequences',
      () => import('./sequence/sequence-player.js'),
      (code) => code.openSequence,
    ),
  },
  {
    name: 'file',
    matches: () => true,
    open: (request, options, acquiring) =>
      openFile(request, options, acquiring, (...asked) => kindOf(request, asked[3]).open(...asked)),
  },
];

/**
 * Returns the kind of a requested source.
 * @param found Manifest that the file of the request turned out to be; absent before it is read.
 */
export const kindOf = (request: SceneRequest, found?: LoadedSequence): SourceKind =>
  SOURCE_KINDS.find((kind) => kind.matches(request, found))!;

const isEmpty = (contract: unknown): boolean => contract === undefined || contract === null || contract === '';

/**
 * Returns the text that identifies the kind of a file: the path of an address, or the name that a page has appended to
 * an object URL.
 */
function nameIn(url: string): string {
  if (!URL.canParse(url)) return url;
  const { pathname, protocol, hash } = new URL(url);
  return protocol === 'blob:' ? hash : pathname;
}
