/**
 * Signatures of known but unsupported splat files and companion files, and remedies for people. This module is loaded
 * with diagnose.ts after a file has been rejected.
 */
import { startsWith } from './bytes.js';

/** A kind of file that is recognized only for an error message. */
export interface UnreadKind {
  readonly found: string;
  readonly remedy: string;
  /** Extensions of the file name, without the dot. */
  readonly extensions?: RegExp;
  /** Whether a file is of this kind, from its bytes or from its first KiB as text. */
  readonly fits?: (bytes: Uint8Array, text: string) => boolean;
  /** Matches a path that only archives of this kind contain. */
  readonly within?: RegExp;
}

const CONVERT = 'convert it to SPZ or PLY, for example with splat-transform or SuperSplat';
const EXPORT = 'save the splats as PLY with the trainer that wrote it, and give that file';

export const UNREAD_KINDS: readonly UnreadKind[] = [
  {
    found: 'a .splatv scene, whose splats move',
    remedy: 'export each moment as a PLY or SPZ of its own, and show them as a sequence',
    extensions: /^splatv$/,
    // Magic number of the format: 0x674b as a 32-bit little-endian integer.
    fits: (bytes) => startsWith(bytes, [0x4b, 0x67, 0, 0]),
  },
  {
    found: 'a .spx scene of Reall3dViewer',
    remedy: 'convert it to SPZ or PLY with gsbox',
    extensions: /^spx$/,
    fits: (bytes) => startsWith(bytes, 'spx') && bytes[3] > 0 && bytes[3] < 16,
  },
  {
    found: 'a head of LAM, whose splats follow an animated mesh',
    remedy: 'export the splats of one pose as PLY, or a generator that holds the mesh',
    within: /(^|\/)offset\.ply$/i,
  },
  {
    found: 'a checkpoint of PyTorch',
    remedy: EXPORT,
    extensions: /^(pt|pth|ckpt)$/,
    within: /(^|\/)data\.pkl$/,
  },
  {
    found: 'arrays of NumPy',
    remedy: EXPORT,
    extensions: /^np[yz]$/,
    fits: (bytes) => startsWith(bytes, '\x93NUMPY'),
    within: /\.npy$/i,
  },
  {
    found: 'an I3S scene layer',
    remedy: CONVERT,
    extensions: /^(slpk|i3s)$/,
    within: /(^|\/)3dSceneLayer\.json(\.gz)?$/i,
  },
  {
    found: 'a tile, or a tileset, of 3D Tiles',
    remedy: 'give one of the .glb files that it names, or convert the tiles to SPZ or PLY',
    extensions: /^(b3dm|pnts|i3dm|cmpt)$/,
    fits: (_, text) => /"geometricError"\s*:/.test(text),
  },
];

/**
 * Returns the unsupported kind of a file; undefined if it is of no known kind.
 * @param text The first KiB of the file as text.
 * @param extension Extension of the file name in lower case, with its dot; may be empty.
 */
export function unreadKind(bytes: Uint8Array, text: string, extension: string): UnreadKind | undefined {
  const end = extension.slice(1);
  return (
    UNREAD_KINDS.find(({ extensions }) => extensions?.test(end)) ?? UNREAD_KINDS.find(({ fits }) => fits?.(bytes, text))
  );
}
