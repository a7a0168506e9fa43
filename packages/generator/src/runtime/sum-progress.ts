/** Hears how many bytes have arrived, and of how many; undefined while that is not known. */
export type ProgressListener = (loaded: number, total: number | undefined) => void;

/** Listeners for each of several downloads that tell one of their sum. Its total is known once that of each is. */
export function sumProgress(count: number, onProgress: ProgressListener): readonly ProgressListener[] {
  const downloads: { loaded: number; total: number | undefined }[] = Array.from({ length: count }, () => ({
    loaded: 0,
    total: undefined,
  }));
  return downloads.map((download) => (loaded, total) => {
    Object.assign(download, { loaded, total });
    const sum = downloads.reduce<number | undefined>((sum, { total }) => addUnlessUnknown(sum, total), 0);
    onProgress(
      downloads.reduce((sum, { loaded }) => sum + loaded, 0),
      sum,
    );
  });
}

const addUnlessUnknown = (a: number | undefined, b: number | undefined): number | undefined =>
  a === undefined || b === undefined ? undefined : a + b;
