/** A fault in a WebP file; the caller knows the file's name and makes it an error for people. */
export class WebpError extends Error {
  /** True if the file may merely be cut. */
  readonly isCut: boolean;
  /** True if the file is sound but of a kind that is not read. */
  readonly isForeign: boolean;

  constructor(found: string, kind: 'damaged' | 'cut' | 'foreign' = 'damaged') {
    super(found);
    this.isCut = kind === 'cut';
    this.isForeign = kind === 'foreign';
  }
}
