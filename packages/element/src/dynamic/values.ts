/** Values that attributes write as text and properties hold as numbers: poses and controls. */

/** Numbers in any format of authors: a number, a list, nested lists, a typed array, or any of these as text. */
export type Numbers = string | number | ArrayLike<number> | readonly (ArrayLike<number> | number)[];

/**
 * The flattened numbers. Text is JSON or numbers separated by spaces or commas.
 * @returns Undefined for no value, and for anything but finite numbers.
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

/** An image for a model: its URL, or an image source. */
export type ImageSource = string | Blob | GPUCopyExternalImageSource;

/** For an input of several images, a list, or addresses separated by spaces. */
export type ImageSources = ImageSource | readonly ImageSource[];

/** Controls of a page by the names of the model's inputs: numbers, or images for image inputs. */
export type ControlValues = Readonly<Record<string, Numbers | ImageSources>>;

/** Controls, sorted by type. */
export interface ReadControls {
  readonly controls: Readonly<Record<string, readonly number[]>>;
  readonly images: Readonly<Record<string, ImageSources>>;
}

/**
 * Reads the controls of an element: its attributes, overridden by its property. Values other than numbers may be
 * images, which is known once the model is loaded. Empty ones are reported to `warn`.
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
    else warn(`<gaussian-splat>: control ${name} expects numbers, found ${JSON.stringify(value)}; its default counts.`);
  }
  return { controls, images };
}

const isPixels = (value: unknown): boolean =>
  Array.isArray(value)
    ? value.some((each) => typeof each === 'string' || isPixels(each))
    : typeof value === 'object' && value !== null && !ArrayBuffer.isView(value);

/** The value of a name; attributes have no capital letters. */
export const valueOf = <T>(values: Readonly<Record<string, T>>, name: string): T | undefined =>
  values[name] ?? values[name.toLowerCase()];
