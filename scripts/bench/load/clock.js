/** Records the times of events, and the longest task of the main thread until the scene is visible. */
export function begin() {
  const start = performance.now();
  const recorded = {};
  let longestMs = 0;
  const watch = (entries) => entries.forEach(({ duration }) => (longestMs = Math.max(longestMs, duration)));
  const observer = new PerformanceObserver((list) => watch(list.getEntries()));
  observer.observe({ entryTypes: ['longtask'] });
  const frame = () => new Promise(requestAnimationFrame);
  return {
    note: (name) => (recorded[name] ??= performance.now() - start),
    /** Two frames later, when the drawn frame is visible. */
    end: async () => {
      await frame();
      await frame();
      watch(observer.takeRecords());
      observer.disconnect();
      return { ...recorded, loadMs: performance.now() - start, longestMs };
    },
  };
}
