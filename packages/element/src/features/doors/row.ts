import { flag } from '../../viewer/attribute.js';
import type { FeatureRow } from '../../viewer/features.js';

export const DOORS_ATTRIBUTES = {
  /**
   * Shows a plan of all rooms that doors lead to, drawn from the maps of their floors. A click on a room goes there.
   * @example floor-plan
   */
  floorPlan: flag(),
};
type Table = typeof DOORS_ATTRIBUTES;

export interface RoomChangeDetail {
  /** Absolute URL of the scene that is shown now. */
  readonly url: string;
  /** Absolute URL of the scene before it. */
  readonly from: string;
}

/**
 * Doors between scenes: children with `data-door`, the address of the scene behind them.
 *
 * @csspart floor-plan - The plan of the attribute `floor-plan`.
 * @cssproperty [--floor-plan-width=180px] - Width of the plan.
 * @fires {CustomEvent<RoomChangeDetail>} room-change - Fired when a door has led to another scene, which is shown.
 */
export const doors: FeatureRow = {
  what: 'the code for doors',
  attributes: DOORS_ATTRIBUTES,
  children: ':scope>[data-door]',
  childAttributes: ['data-door', 'data-room', 'data-heading', 'data-arrival-heading', 'data-floor-map'],
  open: async (viewer) => {
    const [{ Doors }] = await Promise.all([import('./doors.js'), viewer.announcer.get()]);
    return new Doors(viewer);
  },
};

declare module '../../viewer/events.js' {
  interface GaussianSplatEventMap {
    /** Fired when a door has led to another scene, which is shown. */
    'room-change': CustomEvent<RoomChangeDetail>;
  }
}

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
