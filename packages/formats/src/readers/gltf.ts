import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { grouped } from '../bytes.js';
import { openContainer, type Json } from '../gltf/container.js';
import { GltfDocument } from '../gltf/document.js';
import { multiply, placedMeshes, type Affine } from '../gltf/nodes.js';
import { isSplats, readPrimitive } from '../gltf/primitive.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource } from '../scene-format.js';
import { transformCloud } from '../transform/transform-cloud.js';
import { noParts } from './sog.js';

/** glTF's axes are left, up and forward, seen from what is shown; a cloud's are right, down and forward. */
const TO_CLOUD: Affine = [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0];

/** The same mesh in many places is copied for each: at most so many bytes of splats for each byte of the file. */
const MAX_GROWTH = 4_096;

/**
 * Reads glTF 2 and GLB with `KHR_gaussian_splatting`: all primitives of the default scene that hold splats, each moved by its nodes
 * (spherical harmonics turn along), uncompressed or as SPZ. Degrees may differ. Meshes and points without the extension,
 * cameras, lights and animations are left out.
 */
export async function readGltf(source: SceneSource): Promise<GaussianCloud> {
  const { bytes, name, signal } = source;
  const document = new GltfDocument(openContainer(bytes, name), name, source.openPart ?? noParts(name));
  const clouds: GaussianCloud[] = [];
  let splats = 0;
  let others = 0;
  for (const { mesh, toScene } of placedMeshes(document)) {
    const { primitives } = document.item('meshes', mesh);
    if (!Array.isArray(primitives)) document.fail(`meshes[${mesh}].primitives`, 'a list', primitives);
    for (const [k, primitive] of (primitives as unknown[]).entries()) {
      signal?.throwIfAborted();
      if (!isSplats(primitive)) {
        others++;
        continue;
      }
      const cloud = await readPrimitive(document, primitive, `meshes[${mesh}].primitives[${k}]`, signal);
      splats += cloud.count;
      if (splats > MAX_GROWTH * bytes.length)
        document.fail('nodes', 'a mesh in some places', `${grouped(splats)} splats`);
      transformCloud(cloud, multiply(TO_CLOUD, toScene));
      clouds.push(cloud);
    }
  }
  if (clouds.length === 0) throw noSplats(document.json, name, others);
  if (clouds.length === 1) return clouds[0];
  return mergeClouds(
    clouds.map((cloud) => ({ cloud, first: 0, count: cloud.count })),
    name,
  );
}

function noSplats({ meshes }: Json, name: string, others: number): GaussianSplatError {
  const count = Array.isArray(meshes) ? meshes.length : 0;
  return new GaussianSplatError('decode/not-splats', {
    where: name,
    expected: 'glTF with splats (the extension KHR_gaussian_splatting) in its scene',
    found: `${count} meshes, and ${others} primitives of other kinds in the scene`,
    remedy: 'show meshes with <model-viewer>, or export the scene with KHR_gaussian_splatting',
  });
}
