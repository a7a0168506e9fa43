/** Sliders beside fields of numbers: each changes its part of the field's text. */

/**
 * @param form {HTMLFormElement} with `input[type=range][data-of]`: the field's name, the place of the part in its text, and its unit
 * @param onChange {() => void}
 */
export function connectSliders(form, onChange) {
  form.addEventListener('input', ({ target }) => {
    if (target.dataset.of === undefined) return;
    const field = form.elements[target.dataset.of];
    field.value = partsOf(form, field)
      .map((part, i) => (i === Number(target.dataset.part) ? `${target.value}${target.dataset.unit}` : part))
      .join(' ');
    onChange();
  });
}

/** Sets the sliders to the values of the fields. */
export function alignSliders(form) {
  for (const slider of slidersOf(form)) {
    const part = partsOf(form, form.elements[slider.dataset.of])[Number(slider.dataset.part)];
    const { unit } = slider.dataset;
    const value = part.endsWith(unit) ? parseFloat(part) : NaN;
    slider.value = Number.isNaN(value) ? slider.dataset.start : value;
  }
}

const slidersOf = (form, name) =>
  [...form.querySelectorAll('input[data-of]')].filter(({ dataset }) => name === undefined || dataset.of === name);

/** The parts of a field's text, those that it leaves out as their sliders begin. */
function partsOf(form, field) {
  const written = field.value.trim().split(/\s+/);
  return slidersOf(form, field.name).map(({ dataset }, i) => written[i] || `${dataset.start}${dataset.unit}`);
}
