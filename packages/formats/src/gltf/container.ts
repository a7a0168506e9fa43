import { GaussianSplatError } from '@gaussian-splat/core';
import { asciiOf, grouped, startsWith, viewOf } from '../bytes.js';
import { damaged } from '../faults.js';
import { parseJson, show, type JsonSource } from '../json.js';

export type Json = Record<string, unknown>;

/** JSON and binary chunk of a glTF file. */
export interface GltfFile {
  readonly json: Json;
  /** Binary chunk of a GLB, which is the content of its first buffer. Undefined for glTF in JSON. */
  readonly binary: Uint8Array | undefined;
}

const MAX_JSON_BYTES = 1 << 26;
/** Maximum size of a glTF in JSON, whose buffers may be embedded. Browsers do not support much longer strings. */
const MAX_TEXT_BYTES = 500_000_000;
const HEADER_BYTES = 12;

/**
 * Matches extensions that do not prevent drawing splats if a file requires them: materials, textures, lights, metadata,
 * and compression of meshes. Integer attributes (`KHR_mesh_quantization`) and meshopt are supported.
 */
const HARMLESS =
  /^(KHR_mesh_quantization|(EXT|KHR)_meshopt_compression|KHR_draco_mesh_compression|[A-Z0-9]+_(animation|audio|lights?|materials?|mesh_features|structural_metadata|textures?|xmp)(_|$))|^KHR_gaussian_splatting(_compression_spz(_2)?)?$/;

/**
 * Parses the container of a GLB, or a glTF in JSON.
 * @param known Matches the extensions that a file may require.
 * @throws GaussianSplatError `decode/unsupported` for a required extension that `known` does not match, as the
 * specification demands, or another version; `decode/header`, `decode/truncated`, `decode/corrupt`,
 * `out-of-memory/budget`
 */
export function openContainer(source: JsonSource, known = HARMLESS): GltfFile {
  const { bytes, name } = source;
  const file = startsWith(bytes, 'glTF')
    ? openGlb(source)
    : { json: parseJson(source, MAX_TEXT_BYTES), binary: undefined };
  const { asset, extensionsRequired } = file.json;
  const version = typeof asset === 'object' && asset !== null ? (asset as Json).version : undefined;
  if ('geometricError' in file.json && 'root' in file.json) throw tileset(name);
  if (typeof version !== 'string' || !version.startsWith('2.')) {
    throw damaged(`${name}, asset.version`, 'glTF 2.x', show(version), 'decode/unsupported');
  }
  const unknown: unknown = Array.isArray(extensionsRequired)
    ? extensionsRequired.find((extension) => typeof extension !== 'string' || !known.test(extension))
    : undefined;
  if (unknown !== undefined) {
    throw new GaussianSplatError('decode/unsupported', {
      where: `${name}, extensionsRequired`,
      expected: 'supported extensions, or extensions that splats do not need',
      found: show(unknown),
      remedy: WITHOUT.find(([extension]) => extension.test(String(unknown)))?.[1] ?? CONVERT,
    });
  }
  return file;
}

const CONVERT =
  'convert the scene to SPZ or PLY with a tool that knows the extension, or export it with KHR_gaussian_splatting alone';
/** Remedies for required extensions that are common and unsupported. */
const WITHOUT: readonly (readonly [extension: RegExp, remedy: string])[] = [
  [/spz/i, 'export the scene again with KHR_gaussian_splatting_compression_spz_2, or give the SPZ that it was made of'],
];

/** Maximum number of extensions that a warning names. */
const MAX_NAMED = 6;

/** Returns a warning that names the extensions that a file uses and `known` does not match; empty without any. */
export function leftOutExtensions({ extensionsUsed }: Json, known = HARMLESS): string[] {
  const used: unknown[] = Array.isArray(extensionsUsed) ? extensionsUsed : [];
  const unknown = [...new Set(used.map(String))].filter((extension) => !known.test(extension));
  const named = unknown.slice(0, MAX_NAMED).map((extension) => extension.slice(0, 80));
  return unknown.length > 0 ? [`Extensions of glTF that are not known are left out: ${named.join(', ')}.`] : [];
}

function tileset(name: string): GaussianSplatError {
  return new GaussianSplatError('decode/unsupported', {
    where: name,
    expected: 'a glTF',
    found: 'a tileset of 3D Tiles',
    remedy: 'give one of the .glb files that it names, or convert the tiles to SPZ or PLY',
  });
}

function openGlb({ bytes, name, budget }: JsonSource): GltfFile {
  const where = (byte: number): string => `${name}, byte ${grouped(byte)}`;
  const view = viewOf(bytes);
  const need = (end: number): void => {
    if (end > bytes.length) {
      throw damaged(
        `${where(bytes.length)} (end of the file)`,
        `${grouped(end)} bytes`,
        grouped(bytes.length),
        'decode/truncated',
      );
    }
  };
  need(HEADER_BYTES + 8);
  const version = view.getUint32(4, true);
  if (version !== 2) throw damaged(where(4), 'version 2 of GLB', grouped(version), 'decode/unsupported');
  need(view.getUint32(8, true));
  const jsonEnd = HEADER_BYTES + 8 + view.getUint32(HEADER_BYTES, true);
  if (asciiOf(bytes, 16, 20) !== 'JSON') throw damaged(where(16), 'a chunk of JSON', 'another', 'decode/header');
  need(jsonEnd);
  let textEnd = jsonEnd;
  // Some programs pad the JSON with zeros instead of spaces.
  while (bytes[textEnd - 1] === 0) textEnd--;
  const text = bytes.subarray(HEADER_BYTES + 8, textEnd);
  const json = parseJson({ bytes: text, name: `${name}, JSON of the GLB`, budget }, MAX_JSON_BYTES);
  if (!startsWith(bytes, 'BIN\0', jsonEnd + 4)) return { json, binary: undefined };
  const binaryEnd = jsonEnd + 8 + view.getUint32(jsonEnd, true);
  need(binaryEnd);
  return { json, binary: bytes.subarray(jsonEnd + 8, binaryEnd) };
}
