/** Headers of responses. */

/** Returns the length of the body in bytes, if the headers declare it and no encoding; otherwise undefined. */
export function lengthOf({ headers }: Response): number | undefined {
  const encoding = headers.get('Content-Encoding');
  const length = headers.get('Content-Length');
  const isPlain = encoding === null || /^\s*(identity)?\s*$/i.test(encoding);
  return isPlain && length !== null && /^\d+$/.test(length) ? Number(length) : undefined;
}

/** Returns the validator of the file's version: its ETag, else its date; undefined if neither header is readable. */
export function tagOf({ headers }: Response): string | undefined {
  return headers.get('ETag') ?? headers.get('Last-Modified') ?? undefined;
}
