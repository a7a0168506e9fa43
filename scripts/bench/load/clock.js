/** Notes when things happen, and the longest task of the page's thread until the scene is on show. */
export function begin() {
  const start = performance.now();
  const noted = {};
  let longestMs = 0;
  const watch = (entries) => entries.forEach(({ duration }) => (longestMs = Math.max(longestMs, duration)));
  const observer = new PerformanceObserver((list) => watch(list.getEntries()));
  observer.observe({ entryTypes: ['longtask'] });
  const frame = () => new Promise(requestAnimationFrame);
  return {
    note: (name) => (noted[name] ??= performance.now() - start),
    /** Two frames later, when what was drawn is on show. */
    end: async () => {
      await frame();
      await frame();
      watch(observer.takeRecords());
      observer.disconnect();
      return { ...noted, loadMs: performance.now() - start, longestMs };
    },
  };
}
