/** Reader of photographs of a scene, and of their cameras. */
import { existsSync, readdirSync } from 'node:fs';
import { basename, dirname, extname, join } from 'node:path';
import { cameraFromCalibration } from '@gaussian-splat/core';
import { UsageError } from '../command.mjs';
import { readJson } from '../input-file.mjs';

/**
 * Converts a view of training's cameras.json to a calibration. The file has the camera's position, and its axes in the
 * world as columns of `rotation`.
 */
function calibrationOf({ width, height, fx, fy, position, rotation }) {
  const rows = [0, 1, 2].map((axis) => rotation.map((row) => row[axis]));
  const worldToCamera = [
    ...rows.map((row) => [...row, -row.reduce((sum, value, k) => sum + value * position[k], 0)]),
    [0, 0, 0, 1],
  ];
  const K = [
    [fx, 0, width / 2],
    [0, fy, height / 2],
    [0, 0, 1],
  ];
  return { width, height, K, worldToCamera };
}

/**
 * Reads cameras and finds their photographs.
 * @param path {string} Path of cameras.json of 3D Gaussian Splatting's training, or of
 * {views: [{width, height, K, worldToCamera, image}, ...]}.
 * @param images {string | undefined} Folder of the photographs. Default: `images` beside cameras.json, or the folder of a
 * file of views.
 * @param leftOut {string[]} Values of `img_name` of excluded views.
 * @returns [{ id, calibration, camera, photograph }], in the order of the file; `photograph` is a path.
 * @throws UsageError if the file has another structure, or a photograph is missing.
 */
export function readPhotographs(path, images, leftOut = []) {
  const found = readJson(path);
  const ofTraining = Array.isArray(found);
  const list = ofTraining ? found : found?.views;
  const isView = ofTraining
    ? (view) => typeof view?.img_name === 'string' && [view.rotation, view.position].every(Array.isArray)
    : (view) => typeof view?.image === 'string';
  if (!Array.isArray(list) || !list.every(isView))
    throw new UsageError(
      `${path}: expected cameras.json of 3D Gaussian Splatting, or {views: [{width, height, K, worldToCamera, image}, ...]}, found neither`,
    );
  const folder = images ?? (ofTraining ? join(dirname(path), 'images') : dirname(path));
  const files = existsSync(folder) ? readdirSync(folder) : [];
  return list
    .filter(({ img_name }) => !leftOut.includes(img_name))
    .map((view, k) => {
      const id = ofTraining ? basename(view.img_name, extname(view.img_name)) : `${k}`;
      const file = ofTraining ? files.find((name) => basename(name, extname(name)) === id) : view.image;
      const photograph = join(folder, file ?? id);
      if (file === undefined || !existsSync(photograph))
        throw new UsageError(`${path}, view ${k}: expected a photograph, found no ${photograph}`);
      const calibration = ofTraining ? calibrationOf(view) : view;
      return { id, calibration, camera: cameraFromCalibration(calibration, `${path}, view ${k}`), photograph };
    });
}

/** Divides photographs. Every `every`-th photograph judges files, as training holds it out; the others are views. */
export function holdOut(photographs, every) {
  const isHeldOut = (_, k) => k % every === 0;
  return {
    judging: photographs.filter(isHeldOut),
    others: photographs.filter((photograph, k) => !isHeldOut(photograph, k)),
  };
}
