/** Shared parts of SVG charts: colors for light and dark pages, and elements. */

export const styleOf = ({ font }) => `
  svg { --ink: #1d1b18; --quiet: #6b645b; --ground: #fffdf9; --line: #e2dcd2; --own: #b3541e; --peer: #1f6fb2; }
  @media (prefers-color-scheme: dark) {
    svg { --ink: #ece7df; --quiet: #a59d92; --ground: #14120f; --line: #3a332a; --own: #f0a35c; --peer: #7db8ea; }
  }
  svg { font: ${font}px system-ui, sans-serif; }
  text { fill: var(--ink); }
  .label { paint-order: stroke; stroke: var(--ground); stroke-width: 3px; stroke-linejoin: round; }
  .quiet { fill: var(--quiet); }
  .grid { stroke: var(--line); }
  .own { fill: var(--own); } .peer { fill: var(--peer); }
  .front { fill: none; stroke: var(--own); stroke-width: 1.5; stroke-dasharray: 5 4; }
  .unnamed { opacity: 0.35; }
  .leader { stroke: var(--quiet); stroke-width: 0.7; }`;

export const escape = (text) =>
  String(text).replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c]);
export const tag = (name, attributes, content = '') => {
  const text = Object.entries(attributes).map(
    ([key, value]) => ` ${key}="${escape(typeof value === 'number' ? +value.toFixed(2) : value)}"`,
  );
  return content === '' ? `<${name}${text.join('')}/>` : `<${name}${text.join('')}>${content}</${name}>`;
};
export const words = (x, y, content, attributes = {}) => tag('text', { x, y, ...attributes }, escape(content));
