import { describeScenes } from './support/scenes.js';

describeScenes('React', '/net/framework-scenes/scenes-react.tsx', (properties) => properties);
