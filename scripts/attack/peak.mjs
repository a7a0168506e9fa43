/** Peak memory of the processes of a page, on Linux. */
import { existsSync, readdirSync, readFileSync } from 'node:fs';

/**
 * Peak bytes of a Chromium process that this process or a child has started; NaN if the system does not report them.
 * @param type `renderer` or `gpu-process`
 */
export function peakBytes(type = 'renderer') {
  if (!existsSync('/proc/self/status')) return NaN;
  const processes = readdirSync('/proc').filter((name) => /^\d+$/.test(name));
  const peaks = processes.map((pid) => {
    try {
      const isOurs = ancestors(pid).includes(String(process.pid));
      const isOfType = readFileSync(`/proc/${pid}/cmdline`, 'utf8').includes(`--type=${type}`);
      const peak = /VmHWM:\s*(\d+)/.exec(readFileSync(`/proc/${pid}/status`, 'utf8'));
      return isOurs && isOfType && peak ? 1024 * Number(peak[1]) : 0;
    } catch {
      // It has ended meanwhile.
      return 0;
    }
  });
  return Math.max(...peaks);
}

function ancestors(pid) {
  const all = [];
  for (let each = pid; Number(each) > 1;) {
    all.push(each);
    each = /PPid:\s*(\d+)/.exec(readFileSync(`/proc/${each}/status`, 'utf8'))?.[1] ?? '0';
  }
  return all;
}
