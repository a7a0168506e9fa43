/** Meshes are drawn in display-referred colors, like the colors of trained splats, so that the two blend. */
import { neutralToneMapping, output, sRGBTransferOETF, vec4, type Material, type Texture } from './three.js';

/** Intensity of the surrounding light that leaves the base color of a rough gray surface facing the camera unchanged. */
const EVEN_LIGHT = 0.62;

/** Lit materials go through Khronos' PBR Neutral. An unlit one (`KHR_materials_unlit`) has its base color. */
export function showAsDisplayed(material: Material): void {
  const light = material.isMeshBasicMaterial ? output.rgb : neutralToneMapping(output.rgb, 1);
  material.outputNode = vec4(sRGBTransferOETF(light.clamp(0, 1)), output.a);
}

/**
 * Glass transmits the splats and meshes behind it by a fraction, like `alphaMode: BLEND`. It does not tint them: a
 * layer has one alpha for red, green and blue.
 */
export function showThrough(material: Material): void {
  if (!material.transmission) return;
  material.opacity *= 1 - material.transmission;
  material.transmission = 0;
  material.transparent = true;
}

/** Lights a material from all around. An unlit one has an `envMap`, too, of mirrors. */
export function light(material: Material, environment: Texture): void {
  if (material.isMeshBasicMaterial || !('envMap' in material)) return;
  material.envMap = environment;
  material.envMapIntensity = EVEN_LIGHT;
}
