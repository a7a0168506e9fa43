/** Records the calls of a page that take part in its first frame, with their times since the navigation, ms. */

/** [name, start, end] of each call. */
export const calls = [];

const round = (ms) => Math.round(10 * ms) / 10;

/** Records calls of a method. Calls without a promise count as done at once. */
function watch(prototype, method, describe = () => '') {
  const original = prototype?.[method];
  if (!original) return;
  prototype[method] = function (...args) {
    const entry = [`${method} ${describe(args)}`.trim(), round(performance.now()), undefined];
    calls.push(entry);
    const result = original.apply(this, args);
    const end = () => (entry[2] = round(performance.now()));
    if (result?.then) result.then(end, end);
    else end();
    return result;
  };
}

const label = ([descriptor]) => descriptor?.label ?? '';

watch(globalThis.GPU?.prototype, 'requestAdapter');
watch(globalThis.GPUAdapter?.prototype, 'requestDevice');
for (const method of ['createShaderModule', 'createComputePipelineAsync', 'createRenderPipelineAsync', 'createBuffer'])
  watch(globalThis.GPUDevice?.prototype, method, label);
watch(globalThis.GPUBuffer?.prototype, 'mapAsync');
watch(globalThis.GPUQueue?.prototype, 'submit');
watch(globalThis.GPUQueue?.prototype, 'onSubmittedWorkDone');
watch(globalThis.CanvasRenderingContext2D?.prototype, 'drawImage');

const { Worker: Original } = globalThis;
globalThis.Worker = class extends Original {
  constructor(...args) {
    super(...args);
    calls.push(['new Worker', round(performance.now())]);
    this.addEventListener('message', ({ data }) =>
      calls.push([`from worker: ${data?.type}`, round(performance.now())]),
    );
  }

  postMessage(message, transfer) {
    calls.push([`to worker: ${message?.type}`, round(performance.now())]);
    super.postMessage(message, transfer);
  }
};

/** Entries of the performance timeline: fetched files, measures and the first paint. */
export const entries = () =>
  ['resource', 'measure', 'paint', 'longtask']
    .flatMap((type) => performance.getEntriesByType(type))
    .map(({ name, startTime, duration }) => [name.replace(/^.*\//, ''), round(startTime), round(startTime + duration)]);
