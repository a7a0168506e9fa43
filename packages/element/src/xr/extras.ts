/**
 * Code for the attributes `vr`, `ar`, `measure`, `shadow-intensity` and `skybox-image`. Loaded if one of these is set.
 */
import { Lazy } from '@gaussian-splat/core';
import { css, type ReactiveControllerHost } from 'lit';
import type { ShadowHost } from '../shadow/shadow-controller.js';
import type { Sky, SkyHost } from '../sky/sky.js';
import type { XrHost } from './xr-host.js';
import { adoptStyles } from '../styles.js';
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
  readonly measure: Lazy<unknown>;
  readonly shadow: Lazy<unknown>;
  readonly sky: Lazy<Sky>;

  constructor(element: ReactiveControllerHost & HTMLElement, core: XrHost & ShadowHost & SkyHost) {
    adoptStyles(element.shadowRoot!, STYLES);
    const place = element.ownerDocument.createElement('div');
    place.className = 'extras';
    core.surface?.after(place);
    const update = (): void => element.requestUpdate();
    this.vr = new Lazy(
      'the code for VR',
      async () => {
        const [{ XrOffer }, { vrKind }] = await Promise.all([import('./xr-offer.js'), import('./vr.js')]);
        return new XrOffer(element, core, place, vrKind(core));
      },
      update,
    );
    this.ar = new Lazy(
      'the code for AR',
      async () => {
        const { offerAr } = await import('./ar.js');
        return offerAr(element, core, place);
      },
      update,
    );
    this.measure = new Lazy(
      'the code for measuring',
      async () => {
        const [{ Measure }] = await Promise.all([import('./measure.js'), core.behaviors.announcer.get()]);
        return new Measure(element, core, place);
      },
      update,
    );
    this.shadow = new Lazy('the code for shadows', async () => {
      const { ShadowController } = await import('../shadow/shadow-controller.js');
      return new ShadowController(core);
    });
    this.sky = new Lazy('the code for skies', async () => new (await import('../sky/sky.js')).Sky(core), update);
    const warn = ({ message }: Error): void => core.warn(message);
    const find = ({ attributes }: XrHost): void => {
      if (attributes.shadowIntensity) this.shadow.want(warn);
      if (attributes.skyboxImage) this.sky.want(warn);
      if (attributes.vr) this.vr.want(warn);
      if (attributes.ar) this.ar.want(warn);
      if (attributes.measure) this.measure.want(warn);
    };
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
    element.addController({ hostUpdated: () => find(core) });
  }
}
