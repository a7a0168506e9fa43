import type { Viewer } from './element/parts.js';

const nothing = (): undefined => undefined;

/** Returns a viewer with the parts that a feature under test uses. Its element is not rendered. */
export const viewerOf = (parts: object): Viewer =>
  ({
    element: { addController: nothing, requestUpdate: nothing },
    ...{ mayMove: true, isOnShow: true, surface: null },
    requestFrame: nothing,
    ...parts,
  }) as unknown as Viewer;
