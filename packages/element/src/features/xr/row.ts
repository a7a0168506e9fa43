import { flag, text } from '../../viewer/attribute.js';
import { wantHeadset } from '../../gpu/request-device.js';
import type { ImmersiveMethods } from './methods.js';
import type { FeatureRow } from '../../viewer/features.js';

export const XR_ATTRIBUTES = {
  /**
   * Offers VR if the browser has a headset: a button, which the slot `vr-button` replaces, and `activateVR()`.
   * @example vr
   */
  vr: flag(),
  /**
   * Offers AR if the browser supports it: a button, which the slot `ar-button` replaces, and `activateAR()`. The
   * subject of the scene stands on the real floor.
   * @example ar
   */
  ar: flag(),
  /**
   * How AR is shown: `webxr` in the page; `quick-look` on iPhones, with the model of `ios-src` or the splats of `ios-splats`. `scene-viewer` is known and never chosen: it reads no splats.
   * @default `webxr quick-look`
   * @example ar-modes="webxr"
   */
  arModes: text(),
  /**
   * Placement of an object in AR: on the `floor` or on a `wall`.
   * @default `floor`
   * @example ar-placement="wall"
   */
  arPlacement: text(),
  /**
   * `auto` shows an object of AR 0.5 to 1 m large at first, and two fingers scale it. `fixed` keeps its true size, which takes `unit`.
   * @default `auto`
   * @example ar-scale="fixed"
   */
  arScale: text(),
  /**
   * URL of a USDZ model for iPhones, which have no WebXR: a link says that it is a simplified model.
   * @default none
   * @example ios-src="vase.usdz"
   */
  iosSrc: text(),
  /**
   * URL of a USDZ with splats, as `gaussian-splat page --usdz` writes it, for iPhones whose system draws splats: those
   * with `<model>` (Safari 27). They get it in place of `ios-src`. Not tried on a device.
   * @default none
   * @example ios-splats="vase-ar.usdz"
   */
  iosSplats: text(),
};
type Table = typeof XR_ATTRIBUTES;

export interface ImmersiveStatusDetail {
  readonly status: 'not-presenting' | 'session-started' | 'object-placed' | 'failed';
  /** Reason of the failure, in English; only with the status `failed`. */
  readonly reason?: string;
}

export const vr: FeatureRow = {
  what: 'the code for VR',
  by: ({ attributes }) => {
    // The adapter must be requested for headsets before the first scene is loaded.
    if (attributes.vr) wantHeadset();
    return attributes.vr;
  },
  open: async (viewer) => (await import('./offers.js')).offerVr(viewer),
};

/**
 * AR, which brings the attributes and events of VR, too.
 *
 * @slot vr-button - Replaces the button that starts VR.
 * @slot ar-button - Replaces the button that starts AR.
 * @slot exit-ar-button - Replaces the button that ends AR on a phone.
 * @slot ar-prompt - Shown over the image of the camera until the scene is placed in AR.
 * @slot ar-fallback - Shown where the browser has no AR, such as a link for another device.
 * @csspart vr-button - The button of the attribute `vr`.
 * @csspart ar-button - The button of the attribute `ar`.
 * @csspart exit-ar-button - The button that ends AR on a phone.
 * @csspart ar-link - The link to the model of `ios-src` or `ios-splats`.
 * @fires {CustomEvent<ImmersiveStatusDetail>} vr-status - Fired when VR becomes available, starts, ends, or fails.
 * @fires {CustomEvent<ImmersiveStatusDetail>} ar-status - Fired when AR becomes available, starts, ends, or fails, and when the object is placed in the room.
 */
export const ar: FeatureRow = {
  what: 'the code for AR',
  attributes: XR_ATTRIBUTES,
  by: ({ attributes }) => attributes.ar,
  open: async (viewer) => (await import('./offers.js')).offerAr(viewer),
};

declare module '../../viewer/events.js' {
  interface GaussianSplatEventMap {
    /** Fired when VR can be started, has started, has ended, or failed. */
    'vr-status': CustomEvent<ImmersiveStatusDetail>;
    /**
     * Fired when AR can be started, has started, has ended or failed, and when the scene is placed in the real
     * environment.
     */
    'ar-status': CustomEvent<ImmersiveStatusDetail>;
  }
}

declare module '../../viewer/attributes.js' {
  interface FeatureMembers extends ImmersiveMethods {}
}

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
}
