import { sortSplats } from '@gaussian-splat/renderer/webgl';

onmessage = ({ data: { port, positions, details } }) => sortSplats(port, positions, details);
