export { LoadBudget, type LoadLimits } from './budget.js';
export { parseJson } from './json.js';
export { detectFormat } from './detect.js';
export { fetchScene, fileOpenerFor, partAddress, type FetchSceneOptions } from './fetch-scene.js';
export { sceneFormats } from './late-formats.js';
export {
  clipRoomBytes,
  clipRooms,
  packClipIndex,
  takeClipRoom,
  unpackClipIndex,
  type PackedClipIndex,
} from './clip-table.js';
export { fetchRange, type FetchedRange } from './fetch-range.js';
export { assetOfCredits, creditsOf, joinCredits } from './credits.js';
export { outOfMemory } from './scene-errors.js';
export { readLodScene, sogAddress, type LodBox, type LodScene, type SogAddress, type SogRun } from './lod/boxes.js';
export { readCoarsestLevel } from './lod/read-coarsest.js';
export { SogFiles, type FetchBytes } from './lod/sog-files.js';
export { mergeClouds } from './merge-clouds.js';
export { openTree, readNode } from './tree/scene-tree.js';
export type { ReadNode, SceneNode, SceneTree, TreeFiles } from './tree/types.js';
export { readPrefix } from './read-prefix.js';
export { MAX_DROPPED_RATIO, prepareReader, readScene, type ReadSceneOptions } from './read-scene.js';
export { boundedImageHeader, type ImageHeader } from './triangles/image-size.js';
export { readTriangles, type TriangleFile, type TriangleSource } from './triangles/read-triangles.js';
export { Ktx2Decoder } from './triangles/ktx2.js';
export type { ImageFile } from './triangles/images.js';
export { isSequence, MAX_HEADER_BYTES as HEADER_BYTES } from './signatures.js';
export type { FileBytes } from './bytes.js';
export { frameAt, framePath, parseSequence, sequencePaths, type FramePattern, type SceneSequence } from './sequence.js';
export { writeCodedMotion, type WrittenMotion } from './clip/coded-motion.js';
export { HarmonicsTurner } from './clip/turn-harmonics.js';
export { curveBitsFor, roundedCurveValue } from './clip/code-curves.js';
export { readMotion, type MotionFile } from './clip/read-motion.js';
export {
  FADE_NAMES,
  applyMotion,
  ANIMATED_ATTRIBUTES,
  ANIMATED_ATTRIBUTE_NAMES,
  fadeAt,
  movedCloud,
  stillMotion,
  type Fades,
  type Lives,
  type Motion,
  type AnimatedAttributeName,
  type AnimatedAttribute,
} from './motion.js';
export { clipFrame, clipPartBytes, readClipPart, type ClipPartContent } from './clip/clip-parts.js';
export {
  CLIP_HEAD_BYTES,
  clipGroupAt,
  clipIndexBytes,
  MAX_CLIP_INDEX_BYTES,
  parseClip,
  writeClipHead,
  type ClipGroup,
  type ClipHead,
  type ClipIndex,
  type ClipPart,
} from './clip.js';
export type { OpenFile, SceneFormat, SceneFormatName, SceneReader, SceneSource, SplatRange } from './scene-format.js';
export { readSplats, splatRanges, type SplatRanges } from './splat-ranges.js';
export { turned, upright, uprightRotation } from './transform/upright.js';
export { samplePreview } from './preview.js';
