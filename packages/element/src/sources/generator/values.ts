/** Poses and controls: values that are text in attributes, and numbers or images in properties. */

/** A point, as trackers of hands and faces return it. */
export interface Point {
  readonly x: number;
  readonly y: number;
  readonly z: number;
}

/**
 * Numbers in any format that authors may use: a number, a point, a list of them, nested lists, a typed array, or any of
 * these as text.
 */
export type Numbers = string | number | Point | ArrayLike<number> | readonly (ArrayLike<number> | Point | number)[];

/**
 * Returns the flattened numbers of a value. Text is JSON, or numbers separated by spaces or commas.
 * @returns Undefined without a value, and if any element is not a finite number.
 */
export function readNumbers(value: Numbers | null | undefined): number[] | undefined {
  if (value === null || value === undefined || value === '') return undefined;
  const parsed: unknown = typeof value === 'string' ? parseText(value) : value;
  const numbers = flatten(parsed);
  return numbers.length > 0 && numbers.every(Number.isFinite) ? numbers : undefined;
}

function parseText(text: string): unknown {
  if (!text.trim().startsWith('['))
    return text
      .trim()
      .split(/[\s,]+/)
      .map(Number);
  try {
    return JSON.parse(text);
  } catch {
    return undefined;
  }
}

function flatten(value: unknown): number[] {
  if (typeof value === 'number') return [value];
  if (ArrayBuffer.isView(value)) return Array.from(value as unknown as ArrayLike<number>);
  if (isPoint(value)) return [value.x, value.y, value.z];
  return Array.isArray(value) ? value.flatMap(flatten) : [NaN];
}

/** Whether a value has x, y and z, and no w, whose place in a quaternion is not known. */
function isPoint(value: unknown): value is Point {
  const { x, y, z, w } = (value ?? {}) as Partial<Record<string, unknown>>;
  return [x, y, z].every((each) => typeof each === 'number') && w === undefined;
}

/** Prefix of the attributes that hold controls: `control-smile="0.5"`. */
export const CONTROL_PREFIX = 'control-';

/** An image for a model, as its URL, its file, or a source that WebGPU can copy. */
export type ImageSource = string | Blob | GPUCopyExternalImageSource;

/** The image of an input. For an input of several images, it is a list, or addresses separated by spaces. */
export type ImageSources = ImageSource | readonly ImageSource[];

/** Values of controls by the names of the model's inputs: numbers, or images for image inputs. */
export type ControlValues = Readonly<Record<string, Numbers | ImageSources>>;

/** Values of controls by the names of inputs, separated into numbers and images. */
export interface ReadControls {
  readonly controls: Readonly<Record<string, readonly number[]>>;
  readonly images: Readonly<Record<string, ImageSources>>;
}

/**
 * Reads the controls of an element from its attributes and from its property, which has priority. Values other than
 * numbers may be images, which is known only when the model is loaded. `warn` is called for empty and invalid values.
 */
export function readControls(
  attributes: Iterable<{ readonly name: string; readonly value: string }>,
  property: ControlValues | null | undefined,
  warn: (sentence: string) => void,
): ReadControls {
  const written: [string, Numbers | ImageSources][] = [];
  for (const { name, value } of attributes) {
    if (name.startsWith(CONTROL_PREFIX)) written.push([name.slice(CONTROL_PREFIX.length), value]);
  }
  const controls: Record<string, number[]> = {};
  const images: Record<string, ImageSources> = {};
  for (const [name, value] of [...written, ...Object.entries(property ?? {})]) {
    const numbers = isPixels(value) ? undefined : readNumbers(value as Numbers);
    delete controls[name];
    delete images[name];
    if (numbers) controls[name] = numbers;
    else if (isPixels(value) || (typeof value === 'string' && value !== '')) images[name] = value as ImageSources;
    else
      warn(`<gaussian-splat>: control ${name} expects numbers, found ${JSON.stringify(value)}; its default is used.`);
  }
  return { controls, images };
}

const isPixels = (value: unknown): boolean =>
  Array.isArray(value)
    ? value.some((each) => typeof each === 'string' || isPixels(each))
    : typeof value === 'object' && value !== null && !ArrayBuffer.isView(value) && !isPoint(value);

/** Returns the value of a name, or of its lowercase form, because names of attributes have no capital letters. */
export const valueOf = <T>(values: Readonly<Record<string, T>>, name: string): T | undefined =>
  values[name] ?? values[name.toLowerCase()];
