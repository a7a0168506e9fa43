/** Values that attributes write as text and properties hold as numbers: poses and controls. */

/** Numbers in any shape that authors write them: a number, a list, lists of lists, a typed array, or any of these as text. */
export type Numbers = string | number | ArrayLike<number> | readonly (ArrayLike<number> | number)[];

/**
 * The numbers, flattened. Text is JSON or numbers with spaces or commas between them.
 * @returns undefined for nothing, and for what holds anything but finite numbers.
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

/** An image for a model: its URL, or what holds its pixels. */
export type ImageSource = string | Blob | GPUCopyExternalImageSource;

/** Of an input that takes several, a list, or addresses with spaces between them. */
export type ImageSources = ImageSource | readonly ImageSource[];

/** Controls as a page gives them, by the names of the model's inputs: numbers, and images for inputs that take some. */
export type ControlValues = Readonly<Record<string, Numbers | ImageSources>>;

/** Controls, sorted by what they hold. */
export interface ReadControls {
  readonly controls: Readonly<Record<string, readonly number[]>>;
  readonly pictures: Readonly<Record<string, ImageSources>>;
}

/**
 * The controls of an element: its attributes, and above them its property. What holds no numbers may be a picture; whether the model takes
 * one there is known once it is loaded. Empty ones are told to `warn`.
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
  const pictures: Record<string, ImageSources> = {};
  for (const [name, value] of [...written, ...Object.entries(property ?? {})]) {
    const numbers = isPixels(value) ? undefined : readNumbers(value as Numbers);
    delete controls[name];
    delete pictures[name];
    if (numbers) controls[name] = numbers;
    else if (isPixels(value) || (typeof value === 'string' && value !== '')) pictures[name] = value as ImageSources;
    else warn(`<gaussian-splat>: control ${name} expects numbers, found ${JSON.stringify(value)}; its default counts.`);
  }
  return { controls, pictures };
}

const isPixels = (value: unknown): boolean =>
  Array.isArray(value)
    ? value.some((each) => typeof each === 'string' || isPixels(each))
    : typeof value === 'object' && value !== null && !ArrayBuffer.isView(value);

/** The value of a name; attributes have no capital letters. */
export const valueOf = <T>(values: Readonly<Record<string, T>>, name: string): T | undefined =>
  values[name] ?? values[name.toLowerCase()];
