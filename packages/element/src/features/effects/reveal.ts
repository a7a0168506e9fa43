/** Reveal effects of the attribute `reveal-effect`, as changes of splats. */
import { cross, normalize, type Matrix4, type Vector3 } from '@gaussian-splat/core';
import type { SplatChanges } from '@gaussian-splat/renderer/modifiers';
import type { SceneBounds } from '../../viewer/camera/settings.js';

const KINDS = ['none', 'fade', 'grow', 'sweep', 'detail'] as const;

/** Parsed value of the attribute. */
export interface RevealEffect {
  readonly kind: (typeof KINDS)[number];
  /** Axis of `sweep`, in viewer space. */
  readonly axis: Vector3;
  readonly milliseconds: number;
}

const AXES: Readonly<Record<string, Vector3>> = {
  ...{ x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] },
  ...{ '-x': [-1, 0, 0], '-y': [0, -1, 0], '-z': [0, 0, -1] },
};
const DEFAULT_MS = 1500;
export const NO_REVEAL: RevealEffect = { kind: 'none', axis: AXES.y, milliseconds: DEFAULT_MS };
export const REVEAL_FORM = 'none, fade, grow, detail, or sweep with an axis such as -y, and a time such as 2s';

/** Parses the attribute `reveal-effect`. Returns null if it is malformed. */
export function parseReveal(text: string | null): RevealEffect | null {
  let effect = NO_REVEAL;
  for (const term of (text ?? 'none').trim().toLowerCase().split(/\s+/)) {
    const kind = KINDS.find((each) => each === term);
    const [, value, unit] = /^(\d*\.?\d+)(m?s)$/.exec(term) ?? [];
    if (kind) effect = { ...effect, kind };
    else if (term in AXES) effect = { ...effect, axis: AXES[term] };
    else if (value) effect = { ...effect, milliseconds: Number(value) * (unit === 's' ? 1000 : 1) };
    else return null;
  }
  return effect;
}

/** Transform of a shape without volume, so that every point is outside. */
const NOTHING: Matrix4 = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1];
/** Initial fraction of the splats in `detail`, as an exponent of 2. */
const COARSEST = -6;
/** Standard deviation of the front of `sweep`, as a fraction of the radius. */
const FRONT = 0.05;

/**
 * Returns the changes of all splats at a progress.
 * @param progress 0..1; no changes at 1
 * @param bounds Bounds of the scene in world coordinates.
 * @param axis Unit vector of `sweep` in world coordinates.
 */
export function revealedBy(
  { kind }: RevealEffect,
  progress: number,
  { center, radius }: Pick<SceneBounds, 'center' | 'radius'>,
  axis: Vector3,
): SplatChanges {
  if (progress >= 1) return {};
  const eased = progress * progress * (3 - 2 * progress);
  switch (kind) {
    case 'none':
      return {};
    case 'fade':
      return { cuts: [{ shape: 'box', side: 'outside', shapeToWorld: NOTHING, surfaceOpacity: eased }] };
    case 'grow':
      return { grown: eased, center };
    case 'detail':
      return { share: 2 ** (COARSEST * (1 - progress)) };
    case 'sweep': {
      const edge = FRONT * radius;
      const reach = radius + 3 * edge;
      const front = reach * (2 * eased - 1);
      const side = normalize(cross(axis, Math.abs(axis[0]) < 0.5 ? [1, 0, 0] : [0, 1, 0]));
      const other = cross(side, axis);
      const row = (k: number): number[] => [side[k], axis[k], other[k], center[k] + front * axis[k]];
      const shapeToWorld = [...row(0), ...row(1), ...row(2), 0, 0, 0, 1];
      return { cuts: [{ shape: 'plane', side: 'outside', shapeToWorld, opacity: 0, edge }] };
    }
  }
}
