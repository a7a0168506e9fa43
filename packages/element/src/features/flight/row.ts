import type { FeatureRow } from '../../viewer/features.js';

/** Flight by keyboard. */
export const flight: FeatureRow = {
  what: 'the code that flies by keyboard',
  navigation: 'fly',
  by: ({ input, navigation }) => input.enabled && navigation === 'fly',
  open: async (viewer) => new (await import('./fly-controller.js')).FlyController(viewer),
};

declare module '../../viewer/attributes.js' {
  interface FeatureNavigations {
    fly: true;
  }
}
