/** The page's scene as HTML to paste or to download. */

/** The size of the tag: without one it is a box of 300 x 150 pixels. */
const STYLE = 'width: 100%; height: auto; aspect-ratio: 4 / 3';

/** The line that registers the element. @param cdn {string} address of the folder of its build, with a slash at the end */
export const scriptOf = (cdn) => `<script type="module" src="${escape(cdn)}gaussian-splat.min.js"></script>`;

/**
 * The same scene in a frame, for sites that take no script. Some remove the style: width and height are then the size.
 * @param cdn {string} address of the folder, with a slash at the end
 * @param attributes {readonly (readonly [name: string, value: string | true])[]}
 */
export function frameOf(cdn, attributes) {
  const query = new URLSearchParams(attributes.map(([name, value]) => [name, value === true ? '' : value]));
  const [, title = ''] = attributes.find(([name]) => name === 'alt') ?? [];
  const address = `${cdn}embed.html?${query}`;
  const isImmersive = attributes.some(([name, value]) => ['vr', 'ar'].includes(name) || value === 'walk');
  const allow = isImmersive ? 'fullscreen; xr-spatial-tracking; gamepad' : 'fullscreen';
  return `<iframe src="${escape(address)}" title="${escape(title)}" width="800" height="600" style="${STYLE}; border: 0" allow="${allow}"></iframe>`;
}

/** Attributes of a cropped scene's own tag: the box belongs to it, and not to the element. */
const OF_SCENE = ['src', 'up', 'crop', 'contract', 'chain', 'pose'];

/**
 * Divides attributes between the tags.
 * @param attributes {readonly (readonly [name: string, value: string | true])[]} true for an attribute without a value.
 * @returns of the element, and of its `<splat-scene>`; null if it has none.
 */
export function tagsOf(attributes) {
  if (!attributes.some(([name]) => name === 'crop')) return { element: attributes, scene: null };
  const isOfScene = ([name]) => OF_SCENE.includes(name);
  return { element: attributes.filter((each) => !isOfScene(each)), scene: attributes.filter(isOfScene) };
}

/**
 * The tag of a scene, with its size.
 * @param attributes {readonly (readonly [name: string, value: string | true])[]} true for an attribute without a value.
 * @param children {readonly string[]} HTML of labels and views
 */
export function sceneOf(attributes, children) {
  const { element, scene } = tagsOf(attributes);
  const own = scene ? [`<splat-scene ${partsOf(scene).join(' ')}></splat-scene>`] : [];
  const content = [...own, ...children].map((child) => `\n  ${child}`).join('');
  return `<gaussian-splat\n  ${partsOf([...element, ['style', STYLE]]).join('\n  ')}\n>${content}${content && '\n'}</gaussian-splat>`;
}

/** A label or a view. */
export const buttonOf = (attributes, text) => `<button ${partsOf(attributes).join(' ')}>${escape(text)}</button>`;

const partsOf = (attributes) =>
  attributes.map(([name, value]) => (value === true ? name : `${name}="${escape(value)}"`));

/** A whole page with a scene. */
export function pageOf(script, scene, title) {
  return `<!doctype html>
<html lang="en">
  <meta charset="utf-8" />
  <meta name="viewport" content="width=device-width, initial-scale=1" />
  <title>${escape(title)}</title>
  ${script}
  <style>
    body { margin: 0 }
    gaussian-splat { display: block }
    gaussian-splat:not(:defined) > :not([slot='poster']) { display: none }
  </style>
${scene}
</html>
`;
}

function escape(value) {
  return value.replaceAll('&', '&amp;').replaceAll('"', '&quot;').replaceAll('<', '&lt;');
}
