/** Poses and controls: values that are text in attributes, and numbers or images in properties. */

/**
 * Numbers in any format that authors may use: a number, a list, nested lists, a typed array, or any of these as text.
 */
export type Numbers = string | number | ArrayLike<number> | readonly (ArrayLike<number> | number)[];

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
  return Array.isArray(value) ? value.flatMap(flatten) : [NaN];
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
    : typeof value === 'object' && value !== null && !ArrayBuffer.isView(value);

/** Returns the value of a name, or of its lowercase form, because names of attributes have no capital letters. */
export const valueOf = <T>(values: Readonly<Record<string, T>>, name: string): T | undefined =>
  values[name] ?? values[name.toLowerCase()];
