/** Memory of the browser's processes, which holds what no heap of the page shows: textures, shaders, the GPU process itself. */
import { readFileSync } from 'node:fs';

const PAGE_BYTES = 4096;

/**
 * Resident bytes of all processes of a browser by their kind (`browser`, `GPU`, `renderer`, ...), as Linux reports them; undefined elsewhere.
 * @param session a devtools session of the browser, not of a page
 */
export async function residentBytes(session) {
  if (process.platform !== 'linux') return undefined;
  const { processInfo } = await session.send('SystemInfo.getProcessInfo');
  const sums = {};
  for (const { type, id } of processInfo) sums[type] = (sums[type] ?? 0) + residentBytesOf(id);
  return sums;
}

function residentBytesOf(id) {
  try {
    return PAGE_BYTES * Number(readFileSync(`/proc/${id}/statm`, 'utf8').split(' ')[1]);
  } catch {
    // It has ended since it was listed.
    return 0;
  }
}
