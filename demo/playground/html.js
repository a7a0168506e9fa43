/** Attributes as HTML that a person can paste. */

/** The line that registers the element, for a page beside the folder `cdn`. */
export const SCRIPT = '<script type="module" src="cdn/gaussian-splat.min.js"></script>';

/**
 * @param attributes {readonly (readonly [name: string, value: string | true])[]} true for an attribute without a value.
 * @returns {string} the tag, on one line or, if that grows long, an attribute on each.
 */
export function tagOf(attributes) {
  const parts = attributes.map(([name, value]) => (value === true ? name : `${name}="${escape(value)}"`));
  const line = `<gaussian-splat ${parts.join(' ')}></gaussian-splat>`;
  return line.length <= 90 ? line : `<gaussian-splat\n  ${parts.join('\n  ')}\n></gaussian-splat>`;
}

function escape(value) {
  return value.replaceAll('&', '&amp;').replaceAll('"', '&quot;').replaceAll('<', '&lt;');
}
