/** `npm start`: installs and builds missing parts, then serves the demo. PORT chooses the port (default 8080). */
import { ensureBuilt, ensureDependencies } from './lib/prepare.mjs';
import { root } from './lib/run.mjs';
import { serve } from '../packages/cli/src/lib/server.mjs';

ensureDependencies();
ensureBuilt();

const wanted = Number(process.env.PORT ?? 8080);
const mounts = { '/': `${root}demo/dist` };
// The home page offers HTML that loads script and scene from this server.
const headers = { 'access-control-allow-origin': '*' };
let server;
try {
  server = await serve(mounts, { port: wanted, headers });
} catch (error) {
  if (error.code !== 'EADDRINUSE') throw error;
  console.log(`Port ${wanted} is taken; using a free one.`);
  server = await serve(mounts, { headers });
}
console.log(`\nThe demo is at http://localhost:${server.address().port}/ (Ctrl+C ends it)\n`);
