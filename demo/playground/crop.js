/** Six sliders for the sides of a box, in the directions that visitors see, and the text of `crop`, which is in the axes of the file. */
import { toScene, viewerFrame } from '../../packages/element/dist/viewer/camera/orbit.js';
import { boxGrammar } from '../../packages/element/dist/viewer/camera/placing-grammar.js';
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
  /** From end to end of the sliders, in the axes of the file: nearly all of the scene. */
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

  /** A scene begins to load: its size is not known yet, unless it is the one that has just been cropped. */
  forget() {
    if (this.#read() === undefined) this.#whole = undefined;
    this.#enable();
  }

  /** A scene is shown. Only the remaining part of a cropped scene is known, so the sliders extend it by half its size. */
  measure() {
    const box = fileBoxOf(this.#scene);
    if (box !== null && this.#read() === undefined) this.#whole = box;
    else if (box !== null) this.#whole ??= around(box);
    this.#enable();
    this.align();
  }

  /** Sets the sliders to the field's value. */
  align() {
    if (this.#whole === undefined) return;
    const box = this.#read() ?? this.#whole;
    for (const slider of this.#sliders) {
      const { axis, corner, isTurned } = this.#sideOf(slider);
      const [min, max] = [this.#whole.min[axis], this.#whole.max[axis]];
      const share = (box[corner][axis] - min) / (max - min || 1);
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
    const { min, max } = this.#read() ?? farAround(this.#whole);
    const box = { min: [...min], max: [...max] };
    const { axis, corner, end, isTurned } = this.#sideOf(slider);
    const share = slider.valueAsNumber / 100;
    const [lowest, highest] = [this.#whole.min[axis], this.#whole.max[axis]];
    box[corner][axis] = lowest + (isTurned ? 1 - share : share) * (highest - lowest);
    // A side that has gone past the one across takes it along.
    const isPast = box.min[axis] > box.max[axis];
    if (isPast) box[OTHER[corner]][axis] = box[corner][axis];
    // At the end of its slider a side cuts nothing, not even the sky.
    if (share === (end === 'max' ? 1 : 0)) box[corner][axis] = farAround(this.#whole)[corner][axis];
    this.#field.value = [...box.min, ...box.max].map((value) => Number(value.toPrecision(5))).join(' ');
    this.align();
  }

  /** Which number of the file's box a slider stands for. */
  #sideOf(slider) {
    const [row, end] = SIDES[slider.dataset.side];
    const frame = viewerFrame(upNow(this.#scene));
    const axis = axesOf(frame)[row];
    const isTurned = frame[row][axis] < 0;
    return { axis, corner: isTurned ? OTHER[end] : end, end, isTurned };
  }
}

/** The axes of the file that are nearest to the three directions of viewer space, each of them once: a file may be tilted. Up chooses first. */
function axesOf(frame) {
  const axes = [];
  for (const row of [1, 0, 2]) {
    const free = [0, 1, 2].filter((axis) => !axes.includes(axis));
    axes[row] = free.reduce((best, axis) => (Math.abs(frame[row][axis]) > Math.abs(frame[row][best]) ? axis : best));
  }
  return axes;
}

/** The box around a scene, in the axes of its file; null if it is unknown. */
function fileBoxOf(scene) {
  const box = scene.getBoundingBox();
  if (box === null) return null;
  const { min, max } = box;
  const frame = viewerFrame(upNow(scene));
  const corners = Array.from({ length: 8 }, (_, i) =>
    toScene(frame, [i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z]),
  );
  const of = (pick) => [0, 1, 2].map((axis) => pick(...corners.map((corner) => corner[axis])));
  return { min: of(Math.min), max: of(Math.max) };
}

/** A hundred times the size of a box farther out: contains the far background of a capture. */
function farAround({ min, max }) {
  const far = min.map((lowest, axis) => 100 * (max[axis] - lowest));
  return {
    min: min.map((lowest, axis) => Math.floor(lowest - far[axis])),
    max: max.map((highest, axis) => Math.ceil(highest + far[axis])),
  };
}

function around({ min, max }) {
  const half = min.map((lowest, axis) => (max[axis] - lowest) / 2);
  return { min: min.map((lowest, axis) => lowest - half[axis]), max: max.map((highest, axis) => highest + half[axis]) };
}
