import type { GaussianSplatElement } from '@gaussian-splat/element';

/** Returns the viewer of an element: the only place where browser tests reach behind its public members. */
export const insideOf = (element: Element) => (element as GaussianSplatElement)['core'];
