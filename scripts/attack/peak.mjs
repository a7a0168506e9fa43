/** The most memory that a page's process has had, where the system tells: on Linux. */
import { existsSync, readdirSync, readFileSync } from 'node:fs';

/** Bytes at most of a renderer process of Chromium that this process, or a child of it, has started; NaN where the system does not tell. */
export function peakBytes() {
  if (!existsSync('/proc/self/status')) return NaN;
  const processes = readdirSync('/proc').filter((name) => /^\d+$/.test(name));
  const peaks = processes.map((pid) => {
    try {
      const isOurs = ancestors(pid).includes(String(process.pid));
      const isRenderer = readFileSync(`/proc/${pid}/cmdline`, 'utf8').includes('--type=renderer');
      const peak = /VmHWM:\s*(\d+)/.exec(readFileSync(`/proc/${pid}/status`, 'utf8'));
      return isOurs && isRenderer && peak ? 1024 * Number(peak[1]) : 0;
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
