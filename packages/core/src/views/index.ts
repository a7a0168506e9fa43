/** First views of scenes: `@gaussian-splat/core/views`. */
export * from './inner-view.js';
export * from './viewer-frame.js';
