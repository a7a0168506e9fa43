/** The views that gsplat's reference images were drawn from. */
import { cameraFromCalibration, type CalibratedView, type Camera } from '@gaussian-splat/core';
import { sharedFile } from './data.js';
import { readPng, type PngImage } from './png.js';

export interface ReferenceView {
  /** Scene and view, for example `skull 01`. */
  readonly name: string;
  /** Scene file within the shared data, for example `scenes/skull.ply`. */
  readonly file: string;
  readonly camera: Camera;
  /** Image files within the shared data. */
  readonly images: { readonly classic: string; readonly antialiased: string };
}

/** A view as `reference/cameras.json` writes it. */
interface ViewEntry extends CalibratedView {
  readonly scene: string;
  readonly name: string;
  readonly file: string;
  readonly images: { readonly classic: string; readonly antialiased: string };
}

/** The near plane is part of how the images were made: cameras.json says so in words, not in a field. */
const REFERENCE_NEAR = 0.2;

/** All reference views, in the order of `reference/cameras.json`. Needs the shared data. */
export function referenceViews(): ReferenceView[] {
  const { views } = JSON.parse(new TextDecoder().decode(sharedFile('reference/cameras.json'))) as {
    views: ViewEntry[];
  };
  return views.map((view) => ({
    name: `${view.scene} ${view.name}`,
    file: view.file,
    camera: cameraFromCalibration(
      { ...view, near: REFERENCE_NEAR },
      `reference/cameras.json ${view.scene} ${view.name}`,
    ),
    images: { classic: `reference/${view.images.classic}`, antialiased: `reference/${view.images.antialiased}` },
  }));
}

/** gsplat's image of a view. */
export const referenceImage = (view: ReferenceView, mode: 'classic' | 'antialiased'): PngImage =>
  readPng(sharedFile(view.images[mode]));
