/** Tasks of a page's main thread, from a trace of Chromium with the categories `toplevel` and `gpu`. */

/** Events of the thread while it waits for the GPU process. */
const WAITS = new Set([
  'CommandBufferProxyImpl::WaitForGetOffset',
  'CommandBufferProxyImpl::WaitForTokenInRange',
  'GpuChannelHost::CreateViewCommandBuffer',
]);

/**
 * Tasks that took longer than a limit in ms, with the time that the thread was running and that it waited for the GPU. The rest of the time it waited for a CPU.
 * @param {Buffer} trace
 * @returns {{ ms: number, cpuMs: number, gpuMs: number, from: string }[]}
 */
export function longTasksOf(trace, limitMs) {
  const { traceEvents } = JSON.parse(trace.toString());
  const keyOf = ({ pid, tid }) => `${pid} ${tid}`;
  const mains = new Set(
    traceEvents
      .filter(({ name, args }) => name === 'thread_name' && args.name === 'CrRendererMain')
      .map((event) => keyOf(event)),
  );
  const ofMains = traceEvents.filter((event) => mains.has(keyOf(event)) && event.dur > 0);
  const waits = ofMains.filter(({ name }) => WAITS.has(name));
  const isWithin = (event, task) =>
    keyOf(event) === keyOf(task) && event.ts >= task.ts && event.ts + event.dur <= task.ts + task.dur;
  return ofMains
    .filter(({ name, dur }) => name === 'ThreadControllerImpl::RunTask' && dur > 1000 * limitMs)
    .map((task) => ({
      ms: Math.round(task.dur / 1000),
      cpuMs: Math.round((task.tdur ?? 0) / 1000),
      gpuMs: Math.round(waits.reduce((sum, wait) => sum + (isWithin(wait, task) ? wait.dur : 0), 0) / 1000),
      from: task.args.src_func,
    }));
}
