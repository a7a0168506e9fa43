export { Lazy } from '@gaussian-splat/core';
