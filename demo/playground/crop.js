/** A box that hides what lies around a scene: six sliders in the directions that visitors see, and the text of `crop`, which is in the axes of the file. */
import { toScene, viewerFrame } from '../../packages/element/dist/camera/orbit.js';
import { boxGrammar } from '../../packages/element/dist/composition/grammar.js';
import { upNow } from './level.js';

/** Each slider: an axis of viewer space, and which of its two ends. */
const SIDES = {
  left: [0, 'min'],
  right: [0, 'max'],
  bottom: [1, 'min'],
  top: [1, 'max'],
  back: [2, 'min'],
  front: [2, 'max'],
};
const OTHER = { min: 'max', max: 'min' };

export class Crop {
  #scene;
  #field;
  #sliders;
  /** What the sliders go across, in the axes of the file: the scene as it was loaded without a box. */
  #whole;

  /**
   * @param scene {HTMLElement} the `<gaussian-splat>`
   * @param field {HTMLInputElement} has the text of `crop`
   * @param sliders {Iterable<HTMLInputElement>} from 0 to 100, `data-side` is a key of SIDES
   * @param onChange {() => void}
   */
  constructor(scene, field, sliders, onChange) {
    this.#scene = scene;
    this.#field = field;
    this.#sliders = [...sliders];
    for (const slider of this.#sliders)
      slider.addEventListener('input', () => {
        this.#write(slider);
        onChange();
      });
  }

  /** Another scene will come: its box is not known yet. */
  forget() {
    this.#whole = undefined;
    this.#enable();
  }

  /** A scene is shown. One that a box cuts already tells no more of itself than this box, so that there is some room around it. */
  measure() {
    const crop = this.#read();
    if (crop === undefined) this.#whole = fileBoxOf(this.#scene);
    else this.#whole ??= around(crop);
    this.#enable();
    this.align();
  }

  /** Brings the sliders to what the field says. */
  align() {
    if (this.#whole === undefined) return;
    const box = this.#read() ?? this.#whole;
    for (const slider of this.#sliders) {
      const { axis, corner, isTurned } = this.#sideOf(slider);
      const [least, most] = [this.#whole.min[axis], this.#whole.max[axis]];
      const share = (box[corner][axis] - least) / (most - least || 1);
      slider.value = 100 * (isTurned ? 1 - share : share);
    }
  }

  #enable() {
    for (const slider of this.#sliders) slider.disabled = this.#whole === undefined;
  }

  #read() {
    const corners = this.#field.value.trim() === '' ? undefined : (boxGrammar.parse(this.#field.value) ?? undefined);
    return corners && { min: corners.slice(0, 3), max: corners.slice(3) };
  }

  #write(slider) {
    const { min, max } = this.#read() ?? this.#whole;
    const box = { min: [...min], max: [...max] };
    const { axis, corner, isTurned } = this.#sideOf(slider);
    const share = slider.valueAsNumber / 100;
    const [least, most] = [this.#whole.min[axis], this.#whole.max[axis]];
    box[corner][axis] = least + (isTurned ? 1 - share : share) * (most - least);
    // A side that has gone past the one across takes it along.
    const isPast = box.min[axis] > box.max[axis];
    if (isPast) box[OTHER[corner]][axis] = box[corner][axis];
    this.#field.value = [...box.min, ...box.max].map((value) => Number(value.toFixed(3))).join(' ');
    this.align();
  }

  /** Which number of the file's box a slider stands for. Where the file is tilted, the nearest. */
  #sideOf(slider) {
    const [row, end] = SIDES[slider.dataset.side];
    const direction = viewerFrame(upNow(this.#scene))[row];
    const sizes = direction.map(Math.abs);
    const axis = sizes.indexOf(Math.max(...sizes));
    const isTurned = direction[axis] < 0;
    return { axis, corner: isTurned ? OTHER[end] : end, isTurned };
  }
}

/** The box around a scene, in the axes of its file. */
function fileBoxOf(scene) {
  const { min, max } = scene.getBoundingBox();
  const frame = viewerFrame(upNow(scene));
  const corners = Array.from({ length: 8 }, (_, i) =>
    toScene(frame, [i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z]),
  );
  const of = (pick) => [0, 1, 2].map((axis) => pick(...corners.map((corner) => corner[axis])));
  return { min: of(Math.min), max: of(Math.max) };
}

function around({ min, max }) {
  const half = min.map((least, axis) => (max[axis] - least) / 2);
  return { min: min.map((least, axis) => least - half[axis]), max: max.map((most, axis) => most + half[axis]) };
}
