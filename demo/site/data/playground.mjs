/** The playground's fields: every attribute of the manifest, in groups; one that no group names is in the last. */
import manifest from './manifest.mjs';

const GROUPS = {
  Basics: ['alt', 'camera-controls', 'auto-rotate', 'up', 'poster', 'loading', 'reveal'],
  Camera: ['camera-orbit', 'camera-target', 'field-of-view', 'views', 'navigation', 'interpolation-decay'],
  Quality: ['quality', 'max-pixel-ratio', 'max-sh-degree', 'filter', 'detail', 'frame-budget', 'order', 'renderer'],
  Interaction: [
    'zoom',
    'touch-action',
    'disable-zoom',
    'disable-pan',
    'disable-tap',
    /^(min|max)-(camera|field)/,
    /^auto-rotate-|^rotation-/,
    /^interaction-prompt/,
  ],
  Generators: ['controls-panel', 'time', 'autoplay', 'loop', 'pose', 'contract', 'chain', 'postprocess', 'gpu-check'],
};
const REST = 'More';
/** Has a field of its own above the others. */
const SOURCE = 'src';
const slider = (title, unit, [min, max, step], start) => ({ title, unit, min, max, step, start });
/** Sliders beside fields of numbers, one for each part of the text. */
const SLIDERS = {
  'camera-orbit': [
    slider('around', 'deg', [-180, 180, 1], 0),
    slider('from the top', 'deg', [0, 180, 1], 75),
    slider('distance', '%', [10, 300, 1], 100),
  ],
  'field-of-view': [slider('angle', 'deg', [10, 120, 1], 45)],
  'interpolation-decay': [slider('milliseconds', '', [0, 1000, 10], 50)],
  'max-pixel-ratio': [slider('pixels', '', [0.25, 3, 0.25], 3)],
  'frame-budget': [slider('milliseconds', '', [1, 16, 0.5], 13)],
  'auto-rotate-delay': [slider('milliseconds', '', [0, 10_000, 500], 3000)],
  'rotation-per-second': [slider('angle', 'deg', [-90, 90, 1], 6)],
  'interaction-prompt-threshold': [slider('milliseconds', '', [0, 10_000, 500], 3000)],
};

export default function playground() {
  const { attributes } = manifest();
  const groupOf = ({ name }) => {
    const isNamed = ([, rules]) => rules.some((rule) => (rule instanceof RegExp ? rule.test(name) : rule === name));
    return Object.entries(GROUPS).find(isNamed)?.[0] ?? REST;
  };
  const fields = attributes
    .filter(({ name }) => name !== SOURCE)
    .map((attribute) => ({
      ...attribute,
      group: groupOf(attribute),
      exampleValue: /=(["'])(.*)\1$/.exec(attribute.example)?.[2] ?? '',
      sliders: SLIDERS[attribute.name] ?? [],
    }));
  return [...Object.keys(GROUPS), REST].map((title) => {
    const rank = ({ name }) => {
      const at = (GROUPS[title] ?? []).indexOf(name);
      return at < 0 ? Infinity : at;
    };
    return { title, fields: fields.filter(({ group }) => group === title).sort((a, b) => rank(a) - rank(b) || 0) };
  });
}
