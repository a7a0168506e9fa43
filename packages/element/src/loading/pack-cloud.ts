export { packCloud } from '@gaussian-splat/renderer/tools';
