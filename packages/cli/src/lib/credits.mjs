import { creditsOf } from '@gaussian-splat/formats';

/** Options of the commands that write scenes or pages. */
export const CREDIT_OPTIONS = { attribution: { type: 'string' }, license: { type: 'string' } };

export const CREDIT_USAGE = `  --attribution TEXT, --license TEXT   credits in place of those of SCENE, which are kept: names, and an SPDX identifier or a few words`;

/**
 * Returns the credits of a file with those of the command line in their place; undefined if there are none.
 * @param own {import('@gaussian-splat/core').Credits | undefined} Credits of the file.
 * @param values {{attribution?: string, license?: string}} Values of {@link CREDIT_OPTIONS}.
 */
export const creditsWith = (own, { attribution = own?.attribution, license = own?.license }) =>
  creditsOf({ attribution, license });

/** Returns a cloud with the credits of {@link creditsWith}. */
export const credited = (cloud, values) => ({
  ...cloud,
  hints: { ...cloud.hints, credits: creditsWith(cloud.hints?.credits, values) },
});
