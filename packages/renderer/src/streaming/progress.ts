/** Pages of a streamed scene on the GPU, and what keeps more of them away. */
export interface StreamProgress {
  /** Number of pages on the GPU. */
  readonly resident: number;
  /** Number of pages of the scene, of all levels and instances. */
  readonly total: number;
  /** Number of pages in transit or fading in. */
  readonly coming: number;
  /** Number of splats of the resident pages, of all levels, rounded up to 256 for each part of a page. */
  readonly splats: number;
  /** Bytes of GPU memory of the slots of the resident pages. */
  readonly bytes: number;
  /**
   * Largest screen error in pixels from a missing page (pages outside the view count a quarter near it, else a
   * sixteenth); 0 if the view has all pages that it needs.
   */
  readonly error: number;
  /**
   * Error threshold in pixels that keeps the view within the splat budget, as in `FrameStats`, or in WebGL the time of
   * frames; 0 if all splats fit.
   */
  readonly budgetError: number;
  /**
   * Why pages that the view needs are missing: they are coming (`transit`), no slots are left for them (`memory`), or
   * they could not be loaded (`failure`). null if none is missing.
   */
  readonly limit: 'transit' | 'memory' | 'failure' | null;
  /** The same as a sentence in English; empty without a limit. */
  readonly reasons: readonly string[];
}

/** Adds the limit to counts of pages. */
export function progressOf({
  lacksSlots,
  ...counts
}: Omit<StreamProgress, 'limit' | 'reasons'> & { readonly lacksSlots: boolean }): StreamProgress {
  const { coming, error } = counts;
  const missing = lacksSlots ? 'memory' : 'failure';
  const limit = coming > 0 ? 'transit' : error > 0 ? missing : null;
  return { ...counts, limit, reasons: limit === null ? [] : [reasonFor(limit, counts)] };
}

function reasonFor(
  limit: 'transit' | 'memory' | 'failure',
  { resident, total, coming, bytes, error }: Omit<StreamProgress, 'limit' | 'reasons'>,
): string {
  const drawn = `${resident} of ${total} pages of the streamed scene are on the GPU`;
  const off = `parts of the view may be off by ${error.toFixed(1)} px`;
  if (limit === 'transit') return `${drawn}; ${coming} are coming.`;
  if (limit === 'memory') return `${drawn}: their memory, ${(bytes / 1e6).toFixed(1)} MB, is full, and ${off}.`;
  return `${drawn}: others could not be loaded, and ${off}.`;
}
