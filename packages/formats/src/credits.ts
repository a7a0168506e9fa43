/** Credits of files: who made a scene, and under which license. The texts come from files, and are not trusted. */
import type { Credits } from '@gaussian-splat/core';
import type { DraftCloud } from './cloud.js';

/** Maximum length of a text in characters, because credits are a line over the frame. */
const MAX_LENGTH = 2000;

/** Returns a text on one line; undefined for other values, and for a text without characters. */
const lineOf = (value: unknown): string | undefined =>
  typeof value === 'string'
    ? value
        .slice(0, MAX_LENGTH)
        .replace(/[\p{Cc}\s]+/gu, ' ')
        .trim() || undefined
    : undefined;

/** Returns the fields of any value of JSON; none for a value that is no object. */
const fieldsOf = (value: unknown): Readonly<Record<string, unknown>> => Object(value) as Record<string, unknown>;

/** Returns the credits in the fields `attribution` and `license` of a manifest; undefined if it has neither. */
export function creditsOf(fields: { readonly attribution?: unknown; readonly license?: unknown }): Credits | undefined {
  const [attribution, license] = [lineOf(fields.attribution), lineOf(fields.license)];
  return attribution || license ? { ...(attribution && { attribution }), ...(license && { license }) } : undefined;
}

/**
 * Returns the credits in the object `asset` of a glTF, or of the JSON of SOG: its `copyright`, or Sketchfab's
 * `extras.author`, and Sketchfab's `extras.license`.
 */
export function creditsOfAsset(asset: unknown): Credits | undefined {
  const { copyright, extras } = fieldsOf(asset);
  const { author, license } = fieldsOf(extras);
  return creditsOf({ attribution: lineOf(copyright) ?? author, license });
}

/** Returns the part of the object `asset` that {@link creditsOfAsset} reads. */
export const assetOfCredits = ({ attribution, license }: Credits = {}): object => ({
  ...(attribution && { copyright: attribution }),
  ...(license && { extras: { license } }),
});

/** Joins credits. Each name and license appears once, and semicolons separate them, as in tiles of 3D Tiles. */
export function joinCredits(all: Iterable<Credits | undefined>): Credits | undefined {
  const distinct = [...new Set(all)].filter((own) => own !== undefined);
  if (distinct.length < 2) return distinct[0];
  const join = (name: keyof Credits): string =>
    [...new Set(distinct.flatMap((own) => own[name]?.split(';').map((text) => text.trim()) ?? []))].join('; ');
  return creditsOf({ attribution: join('attribution'), license: join('license') });
}

/** Adds credits to the metadata of a cloud, if there are any. */
export function addCredits(cloud: DraftCloud, credits: Credits | undefined): void {
  if (credits) cloud.hints = { ...cloud.hints, credits };
}
