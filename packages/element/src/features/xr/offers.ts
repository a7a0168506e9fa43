/** Offers of VR and AR, and the methods of elements that have one. */
import type { Viewer } from '../../viewer/viewer.js';
import type { XrOffer } from './xr-offer.js';

export async function offerVr(viewer: Viewer): Promise<XrOffer> {
  const [{ XrOffer }, { vrKind }] = await Promise.all([import('./xr-offer.js'), import('./vr.js')]);
  addMethods(viewer);
  return new XrOffer(viewer, vrKind(viewer));
}

export async function offerAr(viewer: Viewer): Promise<XrOffer> {
  const { openAr } = await import('./ar.js');
  addMethods(viewer);
  return openAr(viewer);
}

/** Adds the methods of VR and AR to an element. The offers of both may do so. */
function addMethods({ element, features }: Viewer): void {
  const [vr, ar] = [features.get<XrOffer>('vr'), features.get<XrOffer>('ar')];
  const offerOf = (name: 'vr' | 'ar'): XrOffer => {
    const { value } = { vr, ar }[name];
    if (!value) throw new TypeError(`the attribute ${name} is not set, or its code is not loaded yet`);
    return value;
  };
  Object.assign(element, {
    activateVR: () => offerOf('vr').activate(),
    activateAR: () => offerOf('ar').activate(),
    exitXR: () => {
      vr.value?.end();
      ar.value?.end();
    },
  });
  const getters = { canActivateVR: vr, canActivateAR: ar };
  for (const [name, offer] of Object.entries(getters))
    Object.defineProperty(element, name, { configurable: true, get: () => offer.value?.canActivate ?? false });
}
