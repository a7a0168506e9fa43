import type { Camera, GaussianCloud } from '@gaussian-splat/core';

export interface Photograph {
  readonly id: string;
  readonly calibration: object;
  readonly camera: Camera;
  /** Path of the image file. */
  readonly photograph: string;
}
export interface Metrics {
  readonly psnr: number;
  readonly ssim: number;
  readonly lpips?: number;
}
export interface GateVerdict {
  readonly figures: Metrics;
  readonly lost: Metrics;
  /** Standard errors of the mean losses over the photographs. */
  readonly errors: Metrics;
  readonly verdict: 'passes' | 'undecided' | 'fails';
  readonly passes: boolean;
  readonly description: string;
}
export const LIMITS: Readonly<Record<'psnr' | 'ssim' | 'lpips', number>>;
export function neededDecibels(psnr: number): number;
export function runMetrics(
  python: string,
  pairs: readonly (readonly [image: string, photograph: string])[],
): { readonly rows: readonly (Metrics & { readonly lpips: number | null })[]; readonly withoutLpips: string | null };
export function checkPython(python: string): string | null;
export function drawPngs(
  device: GPUDevice,
  cloud: GaussianCloud,
  photographs: readonly Pick<Photograph, 'id' | 'camera'>[],
  folder: string,
): Promise<string[]>;
export class Gate {
  constructor(
    device: GPUDevice,
    options: { readonly photographs: readonly Photograph[]; readonly python: string; readonly folder?: string },
  );
  judge(cloud: GaussianCloud, name: string): Promise<GateVerdict>;
}
