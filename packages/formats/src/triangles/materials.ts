import type { Json } from '../gltf/container.js';
import { isObject } from '../json.js';

const GLOSSINESS = 'KHR_materials_pbrSpecularGlossiness';
/** Reflectance of dielectrics at normal incidence, which `specularColorFactor` multiplies. */
const DIELECTRIC = 0.04;

/**
 * Converts a material of KHR_materials_pbrSpecularGlossiness without a fallback to metalness and roughness. Diffuse and
 * specular colors stay. The gloss in the alpha of its texture is replaced by half of the factor.
 */
export function withRoughness(material: Json): Json {
  const { extensions, pbrMetallicRoughness } = material;
  const own = isObject(extensions) ? extensions[GLOSSINESS] : undefined;
  if (!isObject(own) || pbrMetallicRoughness !== undefined) return material;
  const { diffuseFactor, diffuseTexture, specularFactor, specularGlossinessTexture: texture } = own;
  const gloss = typeof own.glossinessFactor === 'number' ? own.glossinessFactor : 1;
  const specular = Array.isArray(specularFactor) ? specularFactor.slice(0, 3).map(Number) : [1, 1, 1];
  return {
    ...material,
    pbrMetallicRoughness: {
      baseColorFactor: diffuseFactor,
      baseColorTexture: diffuseTexture,
      metallicFactor: 0,
      roughnessFactor: 1 - (texture === undefined ? gloss : gloss / 2),
    },
    extensions: {
      ...(extensions as Json),
      KHR_materials_specular: {
        specularColorFactor: specular.map((value) => value / DIELECTRIC),
        specularColorTexture: texture,
      },
    },
  };
}
