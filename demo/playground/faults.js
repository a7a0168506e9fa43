/** The element's errors about a value, beside its field. */
import { ATTRIBUTES } from '../../packages/element/dist/viewer/attributes.js';
import { SCENE_ATTRIBUTES } from '../../packages/element/dist/features/children/attributes.js';

const ALL = { ...SCENE_ATTRIBUTES, ...ATTRIBUTES };

const propertyOf = (name) => name.replace(/-(.)/g, (_, letter) => letter.toUpperCase());

/** @returns {string} a sentence, empty for a value that the element takes. */
export function faultOf(name, value) {
  const { grammar } = ALL[propertyOf(name)] ?? {};
  if (grammar === undefined || typeof value !== 'string' || value === '' || grammar.parse(value) !== null) return '';
  return `Not used: expected ${grammar.expected}, found "${value}".`;
}

/** Shows a sentence under a field, or takes it away. */
export function showFault(field, sentence) {
  const id = `${field.id}-fault`;
  const line = document.getElementById(id);
  if (sentence === '') {
    line?.remove();
    field.removeAttribute('aria-invalid');
    field.removeAttribute('aria-describedby');
    return;
  }
  field.setAttribute('aria-invalid', 'true');
  field.setAttribute('aria-describedby', id);
  const shown = line ?? Object.assign(document.createElement('p'), { id, className: 'fault' });
  if (line === null) field.after(shown);
  shown.setAttribute('role', 'alert');
  if (shown.textContent !== sentence) shown.textContent = sentence;
}
