/** Replaces `checks.ts` for callers that construct all arguments of a viewpoint themselves. */
export { completed as settingsOf } from './render-settings.js';

export const checkArguments = (): void => undefined;
export const checkFrame = (): void => undefined;
