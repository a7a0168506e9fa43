import type { SplatChild } from './child.js';
import type { Composition } from './composition.js';

/** The compositions of elements that have children. */
export const compositions = new WeakMap<Element, Composition>();

/** Gives a child to its element. One that has not looked at its children yet asks for them itself. */
export function adopt(child: SplatChild): void {
  const { parentElement } = child;
  child.holder.attach((parentElement && compositions.get(parentElement)) ?? null);
}
