/** Classes of features whose methods the element has, too. */
import type * as capture from '../features/recording/capture-image.js';

export type { InputController } from '../features/input/input-controller.js';
export type { HotspotController } from '../features/labels/hotspot-controller.js';
export type { Tour } from '../features/views/tour.js';
/** Functions for images and videos. */
export type Recording = typeof capture;
