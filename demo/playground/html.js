/** Attributes as HTML that a person can paste. */

/** The line that registers the element. @param cdn {string} address of the folder of its build, with a slash at the end */
export const scriptOf = (cdn) => `<script type="module" src="${escape(cdn)}gaussian-splat.min.js"></script>`;

/**
 * The same scene in a frame, for sites that take no script.
 * @param cdn {string} address of the folder, with a slash at the end
 * @param attributes {readonly (readonly [name: string, value: string | true])[]}
 */
export function frameOf(cdn, attributes) {
  const query = new URLSearchParams(attributes.map(([name, value]) => [name, value === true ? '' : value]));
  const [, title = ''] = attributes.find(([name]) => name === 'alt') ?? [];
  const address = `${cdn}embed.html?${query}`;
  return `<iframe src="${escape(address)}" title="${escape(title)}" style="width: 100%; aspect-ratio: 4 / 3; border: 0" allow="fullscreen"></iframe>`;
}

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
