type Metric = 'psnr' | 'ssim' | 'lpips';
export const LIMITS: Readonly<Record<Metric, number>>;
export function standardError(values: readonly number[]): number;
export function verdictOf(losses: Readonly<Partial<Record<Metric, readonly number[]>>>): {
  readonly lost: Partial<Record<Metric, number>>;
  readonly errors: Partial<Record<Metric, number>>;
  readonly verdict: 'passes' | 'undecided' | 'fails';
};
export function countedRows<
  T extends { readonly passes: boolean; readonly encoder?: string; readonly target?: number },
>(rows: readonly T[]): T[];
