/** Labels and views that a visitor puts into the scene: children of the element, rows of a list, and lines of HTML. */
import { buttonOf } from './html.js';

export class Children {
  #scene;
  #list;
  #onChange;
  #items = [];
  #made = 0;

  /**
   * @param scene {HTMLElement} the `<gaussian-splat>`
   * @param list {HTMLElement} takes a row for each
   * @param onChange {() => void}
   */
  constructor(scene, list, onChange) {
    this.#scene = scene;
    this.#list = list;
    this.#onChange = onChange;
  }

  /** @param point {object} of viewer space, as `positionFromPoint()` gives it */
  addLabel(point) {
    this.#add(`Label ${++this.#made}`, [
      ['slot', `hotspot-${this.#made}`],
      ['data-position', String(point)],
    ]);
  }

  /** @param view {Record<string, string>} attributes of the camera */
  addView(view) {
    const data = Object.entries(view).map(([name, value]) => [`data-${name.replace('camera-', '')}`, value]);
    this.#add(`View ${++this.#made}`, [['slot', 'view'], ...data]);
  }

  /** One line of HTML for each. */
  get html() {
    return this.#items.map(({ child, attributes }) => buttonOf(attributes, child.textContent));
  }

  clear() {
    for (const { child, row } of this.#items) for (const node of [child, row]) node.remove();
    this.#items = [];
  }

  #add(text, attributes) {
    const child = Object.assign(document.createElement('button'), { type: 'button', textContent: text });
    for (const [name, value] of attributes) child.setAttribute(name, value);
    const row = document.createElement('li');
    const field = Object.assign(document.createElement('input'), { value: text, ariaLabel: 'Text' });
    const remove = Object.assign(document.createElement('button'), { type: 'button', textContent: 'Remove' });
    const item = { child, row, attributes };
    field.addEventListener('input', () => {
      child.textContent = field.value;
      this.#onChange();
    });
    remove.addEventListener('click', () => {
      for (const node of [child, row]) node.remove();
      this.#items = this.#items.filter((each) => each !== item);
      this.#onChange();
    });
    row.append(field, remove);
    this.#list.append(row);
    this.#scene.append(child);
    this.#items.push(item);
    this.#onChange();
    field.select();
  }
}
