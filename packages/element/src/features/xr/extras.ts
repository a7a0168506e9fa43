/**
 * Code for the attributes `vr`, `ar`, `measure`, `shadow-intensity` and `skybox-image`. Loaded if one of these is set.
 */
import type { Lazy } from '@gaussian-splat/core';
import { css, type ReactiveControllerHost } from 'lit';
import type { Features } from '../../viewer/features.js';
import type { ShadowHost } from '../shadow/shadow-controller.js';
import type { SkyHost } from '../sky/sky.js';
import type { XrHost } from './xr-host.js';
import { adoptStyles } from '../../viewer/styles.js';
import type { XrOffer } from './xr-offer.js';

const STYLES = css`
  .extras {
    position: absolute;
    inset-block-end: 8px;
    inset-inline-start: 8px;
    max-inline-size: calc(100% - 60px);
    display: flex;
    flex-wrap: wrap;
    gap: 8px;
    z-index: 2;
  }
  .extras:empty {
    display: none;
  }
  /* Otherwise the reset button has the corner of these buttons. Here it is above the pause button. */
  .extras:not(:empty) ~ [part='reset-button'] {
    inset-block-end: 52px;
    inset-inline: auto 8px;
  }
  .extras button {
    font: inherit;
    padding: 8px 14px;
    border: 0;
    border-radius: 999px;
    cursor: pointer;
    background: var(--interaction-prompt-background, rgb(0 0 0 / 0.7));
    color: var(--interaction-prompt-color, rgb(255 255 255));
  }
  .extras button[aria-pressed='true'] {
    outline: 2px solid currentcolor;
  }
`;

export class Extras {
  readonly vr: Lazy<XrOffer>;
  readonly ar: Lazy<XrOffer>;

  constructor(
    element: ReactiveControllerHost & HTMLElement,
    core: XrHost & ShadowHost & SkyHost & { readonly features: Features },
  ) {
    adoptStyles(element.shadowRoot!, STYLES);
    const place = element.ownerDocument.createElement('div');
    place.className = 'extras';
    core.surface?.after(place);
    const { features } = core;
    this.vr = features.add('the code for VR', { by: ({ vr }) => vr }, async () => {
      const [{ XrOffer }, { vrKind }] = await Promise.all([import('./xr-offer.js'), import('./vr.js')]);
      return new XrOffer(element, core, place, vrKind(core));
    });
    this.ar = features.add('the code for AR', { by: ({ ar }) => ar }, async () => {
      const { offerAr } = await import('./ar.js');
      return offerAr(element, core, place);
    });
    features.add('the code for measuring', { by: ({ measure }) => measure }, async () => {
      const [{ Measure }] = await Promise.all([import('../ruler/measure.js'), core.behaviors.announcer.get()]);
      return new Measure(element, core, place);
    });
    features.add(
      'the code for shadows',
      { by: ({ shadowIntensity }) => shadowIntensity },
      async () => new (await import('../shadow/shadow-controller.js')).ShadowController(core),
    );
    features.add(
      'the code for skies',
      { by: ({ skyboxImage }) => skyboxImage },
      async () => new (await import('../sky/sky.js')).Sky(core),
    );
    const offerOf = (name: 'vr' | 'ar'): XrOffer => {
      const { value } = this[name];
      if (!value) throw new TypeError(`the attribute ${name} is not set, or its code is not loaded yet`);
      return value;
    };
    Object.defineProperties(element, {
      activateVR: { value: () => offerOf('vr').activate() },
      activateAR: { value: () => offerOf('ar').activate() },
      exitXR: {
        value: () => {
          this.vr.value?.end();
          this.ar.value?.end();
        },
      },
      canActivateVR: { get: () => this.vr.value?.canActivate ?? false },
      canActivateAR: { get: () => this.ar.value?.canActivate ?? false },
    });
  }
}
