import * as React from 'react';

/** Effect that runs before the browser paints. Servers run none, and React 18 warns of layout effects there. */
const useBeforePaint = 'document' in globalThis ? React.useLayoutEffect : React.useEffect;

/** Common attributes that are texts in React, and booleans as properties, which `@lit/react` sets: the text for true. */
const TRUE: ReadonlyMap<string, string> = new Map([
  ['translate', 'yes'],
  ['draggable', 'true'],
]);

/**
 * Wraps a component so that some props are assigned to its element only when they change. `@lit/react` assigns every
 * prop in every render, but an equal value counts for these: the camera returns to its orbit, the clock seeks, and a visitor who went through a door is back in the first room.
 *
 * @param Component Component of an element, as `createComponent` returns it.
 * @param names Names of these props.
 */
export function assignedOnChange<E extends HTMLElement, P extends React.RefAttributes<E>>(
  Component: React.ForwardRefExoticComponent<P>,
  names: readonly (keyof E & keyof P & string)[],
): React.ForwardRefExoticComponent<P> {
  const Wrapped = React.forwardRef<E, P>((props, ref) => {
    const element = React.useRef<E | null>(null);
    const assigned = React.useRef<Record<string, unknown>>({});
    const keep = React.useCallback(
      (node: E | null): void => {
        element.current = node;
        if (typeof ref === 'function') ref(node);
        else if (ref !== null) ref.current = node;
      },
      [ref],
    );
    useBeforePaint(() => {
      for (const name of names) {
        const value: unknown = props[name as keyof typeof props];
        if (!element.current || Object.is(value, assigned.current[name])) continue;
        assigned.current[name] = value;
        Object.assign(element.current, { [name]: value });
      }
    });
    const others = Object.entries(props)
      .filter(([name]) => !(names as readonly string[]).includes(name))
      .map(([name, value]) => [name, TRUE.has(name) && typeof value === 'string' ? value === TRUE.get(name) : value]);
    return React.createElement(Component, { ...Object.fromEntries(others), ref: keep } as unknown as P);
  });
  Wrapped.displayName = Component.displayName;
  return Wrapped as unknown as React.ForwardRefExoticComponent<P>;
}
