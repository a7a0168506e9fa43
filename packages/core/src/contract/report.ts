import { grouped } from '../grouped.js';
import { describeTensor, type OnnxHeader } from '../onnx/header.js';
import { modelMemory } from '../onnx/model-memory.js';
import { gpuNotes } from '../onnx/webgpu-provider.js';
import type { Contract, InputBinding } from './contract.js';
import { tensorNames } from './parse-contract.js';
import type { ResolvedContract } from './resolve-contract.js';
import { findTensor } from './tensor-rules.js';
import { clipped } from './validate.js';

/** Maximum number of characters of a cell. */
const MAX_CELL = 1000;

/** A table for display: all rows have the same number of cells, of 1,000 characters at most. */
export interface ReportSection {
  readonly title: string;
  readonly rows: readonly (readonly string[])[];
}

/**
 * Returns tables that describe a file and its contract, for the command line and pages.
 * @param resolved Contract of the file; undefined if it has no valid one.
 */
export function contractReport(header: OnnxHeader, resolved: ResolvedContract | undefined): ReportSection[] {
  return [
    { title: 'File', rows: fileRows(header) },
    ...(resolved ? [{ title: 'Contract', rows: contractRows(resolved) }] : []),
    { title: 'Inputs', rows: inputRows(header, resolved?.contract) },
    { title: 'Outputs', rows: outputRows(header, resolved?.contract) },
  ]
    .filter(({ rows }) => rows.length > 0)
    .map(({ title, rows }) => ({ title, rows: rows.map((row) => row.map((cell) => clipped(cell, MAX_CELL))) }));
}

function fileRows(header: OnnxHeader): string[][] {
  const { byteLength, irVersion, producer, opsets, operators, externalFiles } = header;
  const used = [...operators].sort(([a], [b]) => (a < b ? -1 : 1)).map(([name, times]) => `${name} ${times}`);
  const rows = [
    ['size', `${grouped(byteLength)} bytes`],
    ['written by', producer || 'unknown'],
    ['versions', [`IR ${irVersion}`, ...[...opsets].map(([domain, version]) => `${domain} ${version}`)].join(', ')],
    ['operators', used.length > 40 ? `${used.slice(0, 40).join(', ')} and ${used.length - 40} more` : used.join(', ')],
  ];
  rows.push(['memory', memoryOf(header)]);
  for (const note of gpuNotes(header)) rows.push(['on the GPU', note]);
  for (const { location, byteLength: length } of externalFiles) {
    rows.push(['external data', `${location}${length > 0 ? `, at least ${grouped(length)} bytes` : ''}`]);
  }
  return rows;
}

/** Returns the memory of a model as text: bytes of its weights, and of its computed tensors of known size. */
function memoryOf(header: OnnxHeader): string {
  const { weightBytes, largestKnownTensorBytes, unknownTensors } = modelMemory(header);
  const facts = [`weights ${grouped(weightBytes)} bytes`];
  if (largestKnownTensorBytes !== null)
    facts.push(`largest computed tensor of known size ${grouped(largestKnownTensorBytes)} bytes`);
  if (unknownTensors > 0) facts.push(`${grouped(unknownTensors)} tensors of a size that only a run determines`);
  return facts.join(', ');
}

const SOURCES: Readonly<Record<ResolvedContract['source'], string>> = {
  explicit: 'given by the caller',
  sidecar: 'file beside the model',
  metadata: "the file's own metadata",
  inferred: 'inferred from names',
};

function contractRows({ contract, source, notes }: ResolvedContract): string[][] {
  const { layout, ...details } = contract.outputs;
  const facts = Object.entries(contract).filter(([name]) => !['$schema', 'inputs', 'outputs'].includes(name));
  return [
    ['source', SOURCES[source]],
    ...notes.map((note) => ['inferred', note]),
    ['layout', [layout, ...Object.entries(details).flatMap(describeDetail)].join(', ')],
    ...facts.map(([name, value]) => [name, typeof value === 'string' ? value : JSON.stringify(value)]),
  ];
}

/** Returns a field of the outputs as text if it is an encoding; names of tensors are in the table of outputs. */
function describeDetail([key, value]: [string, unknown]): string[] {
  return /^(color|.*Activation|.*Order)$/.test(key) ? [`${key} ${String(value)}`] : [];
}

function inputRows(header: OnnxHeader, contract: Contract | undefined): string[][] {
  return header.inputs.map((input) => {
    const binding = contract && Object.hasOwn(contract.inputs, input.name) ? contract.inputs[input.name] : undefined;
    return [input.name, describeTensor(input), binding ? describeBinding(binding) : contract ? 'no role' : ''];
  });
}

function describeBinding({ role, ...details }: InputBinding): string {
  const entries = Object.entries(details).map(([key, value]) => {
    const text = typeof value === 'string' ? value : JSON.stringify(value);
    return `${key} ${clipped(text, 40)}`;
  });
  return [role, ...entries].join(', ');
}

function outputRows(header: OnnxHeader, contract: Contract | undefined): string[][] {
  const fields = new Map(contract ? tensorNames(contract.outputs).map(([field, tensor]) => [tensor, field]) : []);
  const missing = [...fields.keys()].filter((name) => !findTensor(header.outputs, name));
  return [
    ...header.outputs.map((output) => [
      output.name,
      describeTensor(output),
      fields.get(output.name) ?? (contract ? 'not used' : ''),
    ]),
    ...missing.map((name) => [name, 'not in the file', fields.get(name)!]),
  ];
}
