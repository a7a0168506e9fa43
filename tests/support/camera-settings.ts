/** Settings of the element's camera, by its attributes. */
import assert from 'node:assert/strict';
import { type RawAttributes, readAttributes } from './element/parts.js';
import type { CameraSettings } from './element/camera.js';

/** Camera values that attributes set: these, and no others. */
export function settings(given: Partial<RawAttributes> = {}): CameraSettings {
  return readAttributes(given as RawAttributes, assert.fail).camera;
}
