/** Settings of the element's camera, by its attributes. */
import assert from 'node:assert/strict';
import type { RawAttributes } from '../../packages/element/src/viewer/attributes.js';
import { readAttributes } from '../../packages/element/src/viewer/element-attributes.js';
import type { CameraSettings } from '../../packages/element/src/viewer/camera/settings.js';

/** Camera values that attributes set: these, and no others. */
export function settings(given: Partial<RawAttributes> = {}): CameraSettings {
  return readAttributes(given as RawAttributes, assert.fail).camera;
}
