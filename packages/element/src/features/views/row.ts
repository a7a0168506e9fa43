import { text } from '../../viewer/attribute.js';
import type { FeatureRow } from '../../viewer/features.js';

export const VIEWS_ATTRIBUTES = {
  /**
   * Named views that visitors can choose from. Either JSON (as a property, a list), `[{ name, orbit, target, fieldOfView }]`, or the URL of such a file,
   * of `cameras.json` of a trainer, or of the settings of SuperSplat. Children with `data-orbit` are views, too.
   * @example views='[{ "name": "Front", "orbit": "0deg 75deg 100%" }]'
   */
  views: text<object | string | null>(),
};
type Table = typeof VIEWS_ATTRIBUTES;

export interface ViewChangeDetail {
  /** Name of the view. */
  readonly name: string;
  /** Index of the view in the list, from 0. */
  readonly index: number;
}

/**
 * The list of views, and flights between them.
 *
 * @slot view - Buttons of the page for its views, each with `data-orbit`.
 * @csspart views - The bar of the views.
 * @csspart view-name - The name of the current view in that bar.
 * @csspart previous-view - The button of that bar for the previous view.
 * @csspart next-view - The button of that bar for the next view.
 * @cssproperty [--views-display=flex] - `none` hides the bar of the views.
 * @fires {CustomEvent<ViewChangeDetail>} view-change - Fired when the camera starts to move to a view of the list.
 */
export const views: FeatureRow = {
  what: 'the code for views',
  attributes: VIEWS_ATTRIBUTES,
  by: ({ attributes }) => attributes.views,
  children: ':scope>[data-orbit]',
  childAttributes: ['data-orbit'],
  open: async (viewer) => {
    const [{ Tour }] = await Promise.all([import('./tour.js'), viewer.announcer.get()]);
    return new Tour(viewer);
  },
};

declare module '../../viewer/events.js' {
  interface GaussianSplatEventMap {
    /** Fired when the camera starts moving to a view of the list. */
    'view-change': CustomEvent<ViewChangeDetail>;
  }
}

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
