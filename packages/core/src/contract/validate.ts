import type { ContractErrorCode } from '../errors.js';
import type { ContractFault } from './contract-error.js';
import type { Schema } from './schema.js';

/** Number of faults after which the rest of a list or object is not validated. */
const MAX_FAULTS = 60_000;

/** Appends faults one by one, because browsers limit the number of arguments of a call. */
function append(faults: ContractFault[], more: readonly ContractFault[]): void {
  for (const fault of more) faults.push(fault);
}

/**
 * Returns all faults of a parsed JSON value under a schema. If a property (`role`, `layout`) distinguishes alternatives,
 * the faults are those of the selected alternative.
 * @param where Name of the value in faults.
 */
export function validate(value: unknown, schema: Schema, where: string): ContractFault[] {
  if (schema.oneOf) return [...validateOneOf(value, schema, where), ...validateOwn(value, schema, where)];
  return validateOwn(value, schema, where);
}

function validateOwn(value: unknown, schema: Schema, where: string): ContractFault[] {
  const mismatch = mismatchOf(value, schema);
  if (mismatch) return [fault(where, mismatch, describe(value), schema)];
  if (Array.isArray(value)) return validateItems(value, schema, where);
  if (isObject(value)) return validateObject(value, schema, where);
  return [];
}

/** Returns the expected value as text if the value itself violates a keyword; undefined if it does not. */
function mismatchOf(value: unknown, schema: Schema): string | undefined {
  const { type, const: only, enum: choices, minLength, minimum, maximum, exclusiveMinimum, anyOf } = schema;
  if (only !== undefined && value !== only) return JSON.stringify(only);
  if (choices && !choices.includes(value as string)) return `one of ${choices.join(', ')}`;
  if (anyOf && anyOf.every((other) => validate(value, other, '').length > 0)) {
    return anyOf.map(({ type: name }) => `a ${name}`).join(' or ');
  }
  if (type && !hasType(value, type)) return TYPE_NAMES[type];
  if (typeof value === 'string' && minLength && value.length < minLength) return 'a text that is not empty';
  if (typeof value === 'number') {
    if (minimum !== undefined && value < minimum) return `${minimum} or more`;
    if (maximum !== undefined && value > maximum) return `${maximum} or less`;
    if (exclusiveMinimum !== undefined && value <= exclusiveMinimum) return `a number above ${exclusiveMinimum}`;
  }
  if (Array.isArray(value) && (value.length < (schema.minItems ?? 0) || value.length > (schema.maxItems ?? Infinity))) {
    return `a list of ${schema.minItems}`;
  }
  return undefined;
}

const TYPE_NAMES: Readonly<Record<NonNullable<Schema['type']>, string>> = {
  object: 'an object in braces',
  array: 'a list in brackets',
  string: 'a text in quotes',
  number: 'a number',
  integer: 'a whole number',
  boolean: 'true or false',
};

function hasType(value: unknown, type: NonNullable<Schema['type']>): boolean {
  switch (type) {
    case 'object':
      return isObject(value);
    case 'array':
      return Array.isArray(value);
    case 'integer':
      return Number.isInteger(value);
    case 'number':
      return Number.isFinite(value);
    default:
      return typeof value === type;
  }
}

function validateItems(values: readonly unknown[], { items }: Schema, where: string): ContractFault[] {
  const faults: ContractFault[] = [];
  if (items)
    for (let i = 0; i < values.length && faults.length < MAX_FAULTS; i++)
      append(faults, validate(values[i], items, `${where}[${i}]`));
  return faults;
}

function validateObject(value: Record<string, unknown>, schema: Schema, where: string): ContractFault[] {
  const { properties = {}, additionalProperties, required = [], dependentRequired = {} } = schema;
  const faults: ContractFault[] = [];
  for (const [key, inner] of Object.entries(value)) {
    if (faults.length >= MAX_FAULTS) return faults;
    const place = `${where}${/^[\w$]{1,60}$/.test(key) ? `.${key}` : `[${describe(key)}]`}`;
    if (Object.hasOwn(properties, key)) append(faults, validate(inner, properties[key], place));
    else if (additionalProperties) append(faults, validate(inner, additionalProperties, place));
    else if (additionalProperties === false) faults.push(unknownField(place, key, Object.keys(properties), value));
  }
  const missing = new Set(required.filter((key) => !Object.hasOwn(value, key)));
  for (const [key, others] of Object.entries(dependentRequired)) {
    if (Object.hasOwn(value, key))
      others.filter((other) => !Object.hasOwn(value, other)).forEach((o) => missing.add(o));
  }
  for (const key of missing) faults.push(missingField(where, key, properties[key]));
  append(faults, validateConditions(value, schema, where));
  return faults;
}

function validateConditions(value: Record<string, unknown>, schema: Schema, where: string): ContractFault[] {
  return (schema.allOf ?? []).flatMap((part) => {
    if (part.oneOf) return validateOneOf(value, part, where);
    if (!part.if || validateOwn(value, part.if, '').length > 0) return [];
    const missing = part.then?.required?.filter((key) => !Object.hasOwn(value, key)) ?? [];
    // Fields that only a condition requires are described at their definition.
    return missing.map((key) => missingField(where, key, schema.properties?.[key]));
  });
}

/** Validates `oneOf`: alternatives that a property distinguishes, or properties that exclude each other; one must be present. */
function validateOneOf(value: unknown, { oneOf = [], description }: Schema, where: string): ContractFault[] {
  const key = discriminatorOf(oneOf[0]);
  if (key === undefined) {
    const keys = oneOf.flatMap(({ required = [] }) => required);
    const present = isObject(value) ? keys.filter((name) => Object.hasOwn(value, name)) : [];
    if (present.length === 1) return [];
    const found = present.length === 0 ? 'neither' : 'both';
    return [fault(where, `either ${keys.join(' or ')}`, found, { description: 'name exactly one of them' })];
  }
  if (!isObject(value)) return [fault(where, 'an object in braces', describe(value), { description })];
  const meant = oneOf.find(({ properties }) => properties?.[key].const === value[key] && Object.hasOwn(value, key));
  if (meant) return validateOwn(value, meant, where);
  const choices = oneOf.map(({ properties }) => properties?.[key].const).join(', ');
  const found = Object.hasOwn(value, key) ? describe(value[key]) : 'nothing';
  return [fault(`${where}.${key}`, `one of ${choices}`, found, { description })];
}

/** Returns the property whose `const` distinguishes alternatives; undefined if there is none. */
function discriminatorOf({ properties = {} }: Schema): string | undefined {
  return Object.keys(properties).find((key) => properties[key].const !== undefined);
}

function unknownField(where: string, key: string, known: readonly string[], value: object): ContractFault {
  const free = known.filter((name) => !Object.hasOwn(value, name));
  const close = free.find((name) => name.toLowerCase().replace(/_/g, '') === key.toLowerCase().replace(/[_-]/g, ''));
  const expected = free.length > 0 ? `one of the fields ${free.join(', ')}` : 'no other field';
  return schemaFault(
    where,
    expected,
    'an unknown field',
    close ? `rename it to ${close}` : 'remove it, or correct its name',
  );
}

function missingField(where: string, key: string, schema: Schema | undefined): ContractFault {
  return fault(`${where}.${key}`, schema ? expectationOf(schema) : 'a value', 'nothing', schema ?? {});
}

function expectationOf(schema: Schema): string {
  if (schema.const !== undefined) return JSON.stringify(schema.const);
  if (schema.enum) return `one of ${schema.enum.join(', ')}`;
  return schema.type ? TYPE_NAMES[schema.type] : 'a value';
}

function fault(where: string, expected: string, found: string, { description }: Schema): ContractFault {
  return schemaFault(
    where,
    expected,
    found,
    description ? `declare it (${description})` : 'correct it; see docs/contract.md',
  );
}

function schemaFault(where: string, expected: string, found: string, remedy: string): ContractFault {
  const code: ContractErrorCode = 'contract/schema';
  return { code, where, expected, found, remedy };
}

const isObject = (value: unknown): value is Record<string, unknown> =>
  typeof value === 'object' && value !== null && !Array.isArray(value);

/** Returns a value as JSON of at most 60 characters, for messages. */
export function describe(value: unknown): string {
  let json: string | undefined;
  try {
    json = JSON.stringify(value);
  } catch {
    // Nested lists may be deeper than the call stack.
    return 'a value that is too deep to be shown';
  }
  return json === undefined ? 'nothing' : clipped(json, 60);
}

/** Returns the first characters of a text, `max` at most. A file may have names of any length. */
export function clipped(text: string, max: number): string {
  return text.length > max ? `${text.slice(0, max - 3)}...` : text;
}
