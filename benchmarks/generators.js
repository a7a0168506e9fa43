/** The page that times generators alone: sessions of ONNX Runtime on one device, runs back to back, nothing drawn. */
import {
  GeneratorSession,
  inputsOfInstances,
  openModel,
  setRuntimeLocation,
  stackInputs,
} from '@gaussian-splat/generator';
import { deviceDescriptor, ImageTensor } from '@gaussian-splat/renderer';
import { sendReport } from './run/report.js';

const query = new URLSearchParams(location.search);
const RUNS = Number(query.get('runs') ?? 60);
/** Times that the runs are timed; the median is reported. */
const ROUNDS = 5;
/** Milliseconds of runs before the first that is timed: GPUs that were idle run at a fraction of their clock. */
const BUSY_MS = 500;
const WALKER = '../generators/walker/model.onnx';
const DEFAULT_MODELS = `../generators/skull/model.onnx,../generators/plant/model.onnx,${WALKER},${WALKER}*10`;

setRuntimeLocation(new URL('../cdn/onnxruntime/', document.baseURI).href);

/** A state in which everything that a model may depend on differs from one run to the next. */
function stateAt(run, model) {
  const turn = (2 * Math.PI * run) / RUNS;
  const [c, s] = [Math.cos(turn), Math.sin(turn)];
  const joints = model.contract.inputs.pose?.joints?.length ?? 0;
  return {
    camera: {
      ...{ width: 1920, height: 1080, fx: 1500, fy: 1500, cx: 960, cy: 540, near: 0.1, far: 100 },
      worldToCamera: [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 3, 0, 0, 0, 1],
    },
    timeSeconds: ((model.contract.duration ?? 1) * run) / RUNS,
    ...(joints > 0 && { pose: Float32Array.from({ length: 3 * joints }, (_, i) => 0.2 * Math.sin(turn + i)) }),
  };
}

/** Gray images for the inputs that take one. Their size does not change from run to run, so that neither does the work. */
function imagesOf(device, { header, contract }) {
  const inputs = header.inputs.filter(({ name }) => contract.inputs[name].role === 'image');
  return Object.fromEntries(
    inputs.map(({ name, dims }) => {
      const [height, width] = dims.slice(-2).map(Number);
      const image = new ImageTensor(device, { width, height, dtype: 'float32' });
      image.upload(new ImageData(new Uint8ClampedArray(4 * width * height).fill(128), width, height));
      return [name, image];
    }),
  );
}

/** Milliseconds for one run of every instance, on a queue that is waited for at the end of a round only. */
async function measure(device, url, instances) {
  const model = await openModel({ url: new URL(url, document.baseURI).href });
  const fallbacks = [];
  // Not compared with the CPU, which would run meanwhile.
  const makeSession = () => new GeneratorSession(model, device, (reason) => fallbacks.push(reason), false);
  // The one that binds the inputs of each instance; all of them run together where the model takes instances, else one after the other.
  const single = makeSession();
  const isOneRun = model.contract.instances !== undefined;
  const sessions = isOneRun ? [single.forInstances(instances)] : [single];
  while (!isOneRun && sessions.length < instances) sessions.push(makeSession());
  const images = imagesOf(device, model);
  const varying = inputsOfInstances(model.header, model.contract);
  const runAll = async (run) => {
    for (const session of sessions) {
      const states = Array.from({ length: instances / sessions.length }, (_, i) => ({
        ...stateAt(run + 7 * i, model),
        images,
      }));
      const inputs = states.map((state) => single.bind(state));
      await session.run(isOneRun ? stackInputs(inputs, varying) : inputs[0], () => undefined);
    }
  };
  for (const start = performance.now(); performance.now() - start < BUSY_MS;) {
    for (let run = 0; run < RUNS; run++) await runAll(run + 0.5);
    await device.queue.onSubmittedWorkDone();
  }
  const rounds = [];
  while (rounds.length < ROUNDS) {
    const started = performance.now();
    for (let run = 0; run < RUNS; run++) await runAll(run);
    const submitted = performance.now();
    await device.queue.onSubmittedWorkDone();
    rounds.push({ whole: (performance.now() - started) / RUNS, submitting: (submitted - started) / RUNS });
  }
  const { whole, submitting } = rounds.sort((one, other) => one.whole - other.whole)[ROUNDS >> 1];
  const kind = sessions[0].kind;
  await Promise.all(sessions.map((session) => session.release()));
  for (const image of Object.values(images)) image.destroy();
  return {
    ...{ url, instances, runs: sessions.length, rows: model.contract.nMax, kind, fallbacks },
    millisecondsPerRun: whole,
    ofWhichSubmitting: submitting,
    ofAllRounds: rounds.map((round) => round.whole),
  };
}

const [status, figures] = ['status', 'figures'].map((id) => document.getElementById(id));
const report = { kind: 'generators', runs: RUNS, results: [] };
try {
  const adapter = await navigator.gpu.requestAdapter({ powerPreference: 'high-performance' });
  const { vendor, architecture, description } = adapter.info;
  report.gpu = { vendor, architecture, description };
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  for (const asked of (query.get('models') ?? DEFAULT_MODELS).split(',')) {
    const [url, instances = '1'] = asked.split('*');
    status.textContent = `Running ${asked}…`;
    const result = await measure(device, url, Number(instances));
    report.results.push(result);
    figures.hidden = false;
    figures.textContent += `${asked}: ${result.rows} Gaussians, ${result.millisecondsPerRun.toFixed(2)} ms a run, ${result.kind}\n`;
  }
  status.textContent = 'Done.';
} catch (error) {
  report.error = String(error.stack ?? error);
  status.textContent = `It did not work: ${error.message ?? error}`;
}
await sendReport(report, query.get('report'));
