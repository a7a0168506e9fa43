/** The conformance checker as a page: the same reader, the same checks, the same runs and the same tables as the command; and the GPU's numbers beside the CPU's. */
import { GaussianSplatError } from '@gaussian-splat/core';
import {
  checkContract,
  checkFile,
  ContractError,
  contractReport,
  describeFault,
  resolveContract,
} from '@gaussian-splat/core/contract';
import { blobSource, readOnnxHeader } from '@gaussian-splat/core/onnx';

const byId = (id) => document.getElementById(id);

/** Counts up with every drop: an answer that a later drop overtook is not shown. */
let latest = 0;

/** Checks files that came together: a model, perhaps a contract, perhaps external data. */
async function check(files) {
  const turn = ++latest;
  const result = await examine(files).catch(asFaults);
  if (turn === latest) byId('report').replaceChildren(...describe(result));
}

async function examine(files) {
  const isJson = (file) => /\.json$/i.test(file.name);
  const others = files.filter((file) => !isJson(file));
  // A file of another name is examined, too, so that the reader can name its type.
  const model = others.find((file) => /\.onnx$/i.test(file.name)) ?? others[0];
  if (model === undefined) return { name: files[0]?.name ?? 'No file', faults: ['Drop the ONNX file along with it.'] };
  const header = await readOnnxHeader(blobSource(model, model.name));
  const explicit = await files.find(isJson)?.text();
  // Only the dropped files are known: without any other file, external data was not looked up.
  const beside = others.filter((file) => file !== model);
  const sizes = beside.length > 0 ? new Map(beside.map((file) => [file.name, file.size])) : undefined;
  try {
    const resolved = resolveContract({ header, explicit });
    const faults = checkContract(header, resolved.contract, { files: sizes }).map(describeFault);
    const run = faults.length === 0 ? () => runHere(model, explicit, header) : undefined;
    return { name: model.name, sections: contractReport(header, resolved), inferred: resolved.notes, faults, run };
  } catch (error) {
    const found = [...checkFile(header, { files: sizes }).map(describeFault), ...asFaults(error, model.name).faults];
    return { name: model.name, sections: contractReport(header, undefined), faults: found };
  }
}

const RUNTIME = new URL('../cdn/onnxruntime/', document.baseURI).href;

/** Runs a model that keeps its contract, on the CPU and on the GPU. What that takes is loaded now. @returns a report as {@link examine} does */
async function runHere(file, contract, header) {
  if (header.externalFiles.length > 0) {
    return {
      name: file.name,
      faults: ['Its weights are in files beside it: npm run gaussian-splat -- check MODEL --run'],
    };
  }
  const adapter = await navigator.gpu?.requestAdapter({ powerPreference: 'high-performance' });
  if (!adapter) return { name: file.name, faults: ['This browser has no WebGPU: there is nothing to compare with.'] };
  const { deviceDescriptor, openModel, runInPage, setRuntimeLocation } = await import('./run.js');
  setRuntimeLocation(RUNTIME);
  const url = URL.createObjectURL(file);
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  try {
    const model = await openModel({ url, contract });
    const { faults, rows, how } = await runInPage(model, device, await loadRuntime());
    return { name: file.name, sections: [{ title: 'Runs', rows }], faults: faults.map(describeFault), how };
  } finally {
    URL.revokeObjectURL(url);
    device.destroy();
  }
}

let runtime;

/** A copy of ONNX Runtime for the CPU: two sessions of one copy must never run at a time. */
async function loadRuntime() {
  const build = 'Suspending' in WebAssembly ? 'jspi' : 'webgpu';
  // An address of its own makes it a copy of its own.
  runtime ??= import(`${RUNTIME}ort.${build}.bundle.min.mjs?cpu`);
  const ort = await runtime;
  ort.env.logLevel = 'error';
  ort.env.wasm.numThreads = 1;
  ort.env.wasm.wasmPaths = { wasm: `${RUNTIME}ort-wasm-simd-threaded.${build === 'jspi' ? 'jspi' : 'asyncify'}.wasm` };
  return ort;
}

/** Sentences of an error, fault by fault. Errors without a name are bugs, and go to the console. */
function asFaults(error, name = 'This file') {
  if (error instanceof ContractError) return { name, faults: error.faults.map(describeFault) };
  if (error instanceof GaussianSplatError) return { name, faults: [error.message] };
  throw error;
}

function describe({ name, sections = [], inferred = [], faults, run, how }) {
  const count = `${faults.length} fault${faults.length === 1 ? '' : 's'}`;
  const verdict = element('p', faults.length > 0 ? `${name}: ${count}` : `${name} keeps the contract.`);
  verdict.className = `verdict ${faults.length > 0 ? 'bad' : 'good'}`;
  const list = element('ul');
  list.className = 'faults';
  list.append(...faults.map((fault) => element('li', fault)));
  const warning = 'No contract was found; it was inferred from names. Write one to be sure.';
  return [
    verdict,
    ...(how ? [element('p', `${how}.`)] : []),
    ...(run ? [runButton(run, name)] : []),
    ...(faults.length > 0 ? [list] : []),
    ...(inferred.length > 0 ? [element('p', warning)] : []),
    ...sections.map(table),
  ];
}

function runButton(run, name) {
  const place = element('div');
  const button = element('button', 'Run it here');
  button.type = 'button';
  button.addEventListener('click', async () => {
    button.disabled = true;
    button.textContent = 'Running…';
    place.replaceChildren(button, ...describe(await run().catch((error) => asFaults(error, name))));
    button.remove();
  });
  place.className = 'run';
  place.append(button);
  return place;
}

function table({ title, rows }) {
  const body = element('tbody');
  for (const [first, ...rest] of rows) {
    const row = element('tr');
    const head = element('th', first);
    head.scope = 'row';
    row.append(head, ...rest.map((cell) => element('td', cell)));
    body.append(row);
  }
  const result = element('table');
  result.append(element('caption', title), body);
  return result;
}

function element(name, text = '') {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}

byId('files').addEventListener('change', ({ target }) => {
  if (target.files.length > 0) check([...target.files]);
});

const drop = byId('drop');
// A file that misses the field would otherwise replace the page.
for (const type of ['dragenter', 'dragover', 'drop']) addEventListener(type, (event) => event.preventDefault());
for (const type of ['dragenter', 'dragover']) drop.addEventListener(type, () => drop.classList.add('over'));
for (const type of ['dragleave', 'drop']) drop.addEventListener(type, () => drop.classList.remove('over'));
drop.addEventListener('drop', (event) => {
  const files = [...event.dataTransfer.files];
  if (files.length > 0) check(files);
});
