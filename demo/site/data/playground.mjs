/** The playground's fields: every attribute of the manifest, in groups; one that no group names is in the last. */
import manifest from './manifest.mjs';

const GROUPS = {
  Picture: ['quality', 'max-sh-degree', 'detail', 'max-pixel-ratio', 'frame-budget', 'renderer', 'postprocess'],
  Camera: ['camera-controls', 'camera-orbit', 'camera-target', 'field-of-view', 'up', 'navigation'],
  'Scene and page': ['alt', 'poster', 'loading', 'reveal', 'crossorigin'],
  Motion: ['auto-rotate', 'auto-rotate-delay', 'rotation-per-second', 'interpolation-decay'],
  'What people may do': [
    'disable-zoom',
    'disable-pan',
    'disable-tap',
    'touch-action',
    /^(min|max)-(camera|field)/,
    /^interaction-prompt/,
  ],
  Generators: ['time', 'autoplay', 'loop', 'pose', 'contract', 'chain'],
};
const REST = 'More';
/** Has a field of its own above the others. */
const SOURCE = 'src';
/** What a field shows while it is empty: an example, not the default. */
const EXAMPLES = {
  'camera-orbit': '30deg 75deg auto',
  'camera-target': '0m 0m 0m',
  'field-of-view': '40deg',
  'max-sh-degree': '0 to 3',
  detail: '1px',
  'rotation-per-second': '30deg',
  up: '-y, or 0.1 -1 0.2',
};

export default function playground() {
  const { attributes } = manifest();
  const groupOf = ({ name }) => {
    const isNamed = ([, rules]) => rules.some((rule) => (rule instanceof RegExp ? rule.test(name) : rule === name));
    return Object.entries(GROUPS).find(isNamed)?.[0] ?? REST;
  };
  const fields = attributes
    .filter(({ name }) => name !== SOURCE)
    .map((attribute) => ({ ...attribute, group: groupOf(attribute), example: EXAMPLES[attribute.name] ?? '' }));
  return [...Object.keys(GROUPS), REST].map((title) => {
    const rank = ({ name }) => {
      const at = (GROUPS[title] ?? []).indexOf(name);
      return at < 0 ? Infinity : at;
    };
    return { title, fields: fields.filter(({ group }) => group === title).sort((a, b) => rank(a) - rank(b) || 0) };
  });
}
