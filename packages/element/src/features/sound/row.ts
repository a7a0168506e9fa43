import type { SoundProperties } from './sound-properties.js';
import type { FeatureRow } from '../../viewer/features.js';

/**
 * An `<audio>` or `<video>` element of the page that plays along with a moving scene.
 *
 * @slot sound - An `<audio>` or `<video>` element that plays along with a moving scene; its captions are shown.
 * @csspart captions - Lines of the sound's captions.
 * @cssproperty --captions-background - Background of captions.
 * @cssproperty --captions-color - Text color of captions.
 * @cssproperty --captions-font - Font of captions.
 */
export const sound: FeatureRow = {
  what: 'the code for sound',
  children: ':scope>[slot=sound]',
  open: async ({ element }) => {
    const sound = new (await import('./sound.js')).Sound(element);
    sound.childrenChanged();
    return sound;
  },
};

declare module '../../viewer/attributes.js' {
  interface FeatureMembers extends SoundProperties {}
}
