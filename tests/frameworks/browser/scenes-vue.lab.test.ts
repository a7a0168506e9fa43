import { describeScenes } from './support/scenes.js';

describeScenes('Vue', '/net/framework-scenes/scenes-vue.ts', (properties) => properties);
