/** The most memory that the processes of a page have had, if the system tells: on Linux. */
import { existsSync, readdirSync, readFileSync } from 'node:fs';

/**
 * The most bytes that a process of Chromium has taken which this process, or a child of it, has started; NaN where the system does not tell.
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
