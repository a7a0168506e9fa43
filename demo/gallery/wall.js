/** Filters of the wall: one kind of scenes, or all. */
const filters = document.querySelector('[data-filters]');
const buttons = [...filters.querySelectorAll('button')];

for (const button of buttons) {
  button.addEventListener('click', () => {
    for (const each of buttons) each.setAttribute('aria-pressed', String(each === button));
    const { kind } = button.dataset;
    for (const item of document.querySelectorAll('.wall > li')) item.hidden = kind !== '' && item.dataset.kind !== kind;
  });
}
