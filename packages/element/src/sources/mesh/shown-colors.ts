/**
 * Converts meshes to display-referred colors, like those of trained splats, so that meshes and splats blend correctly.
 */
import {
  materialOpacity,
  neutralToneMapping,
  output,
  sRGBTransferOETF,
  texture,
  vec4,
  type Material,
  type Texture,
} from './three.js';

/** Intensity of the environment at which a rough gray surface that faces the camera has its base color. */
const EVEN_LIGHT = 0.62;

/** Whether light changes a material: not `KHR_materials_unlit`, lines and points. */
const isLit = ({ envMapIntensity }: Material): boolean => envMapIntensity !== undefined;

/**
 * Makes a material output sRGB. The colors of lit materials are tone-mapped by Khronos' PBR Neutral; those of other
 * materials stay the base color.
 */
export function showAsDisplayed(material: Material): void {
  const light = isLit(material) ? neutralToneMapping(output.rgb, 1) : output.rgb;
  material.outputNode = vec4(sRGBTransferOETF(light.clamp(0, 1)), output.a);
}

/**
 * Replaces the transmission of a material by transparency, like `alphaMode: BLEND`. Glass does not tint what is behind
 * it, because a layer has one alpha for red, green and blue. The cutoff of `alphaMode: MASK` stays a limit of the alpha
 * in the file.
 */
export function showThrough(material: Material): void {
  const { transmission, transmissionMap } = material;
  if (!transmission) return;
  if (transmissionMap) {
    const opaque = texture(transmissionMap).r.mul(transmission).oneMinus();
    material.opacityNode = materialOpacity.mul(opaque);
    if (material.alphaTest > 0) material.alphaTestNode = opaque.mul(material.alphaTest);
  } else {
    material.opacity *= 1 - transmission;
    material.alphaTest *= 1 - transmission;
  }
  material.transmission = 0;
  material.transparent = true;
}

/** Lights a material by the environment. Skips unlit materials, whose `envMap` would be a mirror reflection. */
export function light(material: Material, environment: Texture): void {
  if (!isLit(material)) return;
  material.envMap = environment;
  material.envMapIntensity = EVEN_LIGHT;
}
