import { flag } from '../../viewer/attribute.js';
import type { PickedPoint } from '../../viewer/camera/values.js';
import type { FeatureRow } from '../../viewer/features.js';

export const RULER_ATTRIBUTES = {
  /**
   * Gives visitors a ruler: a button, then two points by mouse, touch or keyboard. The event `measure` has the length.
   * @example measure
   */
  measure: flag(),
};
type Table = typeof RULER_ATTRIBUTES;

export interface MeasureDetail {
  /** Start of the ruler in viewer space. */
  readonly from: PickedPoint;
  readonly to: PickedPoint;
  /** Length in units of the scene. */
  readonly length: number;
  /**
   * Half of the interval that contains the length in 68 % of the cases or more, in units of the scene. Infinity if an
   * end is on no single surface.
   */
  readonly uncertainty: number;
  /**
   * Distance of the two surfaces at right angles to them, in units of the scene, for example the height of a room; null
   * unless they are parallel within 12 degrees, and for two points of one surface.
   */
  readonly perpendicular: number | null;
  /** Length in meters; null unless the attribute `unit` defines the unit. */
  readonly meters: number | null;
  /** Meters per unit of the scene; null if unknown. */
  readonly unit: number | null;
}

/**
 * The ruler.
 *
 * @csspart measure-button - The button of the attribute `measure`.
 * @csspart measure-label - The length beside the ruler.
 * @cssproperty --measure-background - Background of the length beside the ruler.
 * @cssproperty --measure-color - Color of the ruler and its length.
 * @fires {CustomEvent<MeasureDetail>} measure - Fired when a visitor has measured a length.
 */
export const ruler: FeatureRow = {
  what: 'the code for measuring',
  attributes: RULER_ATTRIBUTES,
  by: ({ attributes }) => attributes.measure,
  open: async (viewer) => {
    const [{ Measure }] = await Promise.all([import('./measure.js'), viewer.announcer.get()]);
    return new Measure(viewer);
  },
};

declare module '../../viewer/events.js' {
  interface GaussianSplatEventMap {
    /** Fired when a visitor has measured a length. */
    measure: CustomEvent<MeasureDetail>;
  }
}

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
