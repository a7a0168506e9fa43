import { GaussianSplatError } from '../errors.js';
import type { ByteSource } from './byte-source.js';
import { diagnoseForeignFile, SIGNATURE_BYTES } from './foreign-file.js';
import {
  emptyHarvest,
  NAME_LIMIT,
  readEntry,
  readFunction,
  readNode,
  readOpset,
  readSparseTensor,
  readTensor,
  readValueInfo,
  type Harvest,
} from './graph-parts.js';
import type { ExternalFile, OnnxHeader, OnnxNode, OnnxTensor, OnnxValue } from './header.js';
import { LoadedBytes, NotLoaded } from './loaded-bytes.js';
import { FieldCursor } from './protobuf.js';

/** Maximum length in bytes of a value of `metadata_props`. */
const METADATA_LIMIT = 2 ** 22;
/** Maximum number of fields in a file, which take about a second to read. */
const FIELD_LIMIT = 10_000_000;

/** Parts of the header that have been read. A field whose bytes are missing leaves them unchanged. */
interface Draft {
  irVersion: number;
  producerName: string;
  producerVersion: string;
  graphName: string;
  hasGraph: boolean;
  readonly opsets: Map<string, number>;
  readonly metadata: Map<string, string>;
  readonly inputs: OnnxTensor[];
  readonly outputs: OnnxTensor[];
  readonly operators: Map<string, number>;
  readonly functions: Set<string>;
  readonly initializers: Set<string>;
  readonly externalFiles: Map<string, ExternalFile>;
  readonly nodes: OnnxNode[];
  readonly stored: Map<string, OnnxValue>;
  readonly values: Map<string, OnnxTensor>;
  initializerBytes: number;
}

/**
 * Reads the description of an ONNX file: inputs, outputs, opsets, metadata, operators and external files. Weights are
 * skipped. For a file of hundreds of megabytes over HTTP Range, two requests fetch the beginning and the end. Each
 * tensor between them that is larger than the source's `chunk` needs one more request.
 *
 * @throws GaussianSplatError `decode/html`, `decode/lfs-pointer` and `decode/unknown-format` for files of other kinds;
 * `decode/truncated` and `decode/corrupt` for damaged ones; `decode/unsupported` for the format ORT and for implausibly
 * large files; errors of the source.
 */
export async function readOnnxHeader(source: ByteSource): Promise<OnnxHeader> {
  const head = await source.read(0, Math.min(SIGNATURE_BYTES, source.size));
  const foreign = diagnoseForeignFile(head, source.name, source.size);
  if (foreign) throw foreign;
  const bytes = new LoadedBytes(source, FIELD_LIMIT);
  const draft = emptyDraft();
  try {
    await readModel(bytes, draft);
  } catch (error) {
    throw looksLikeModel(draft) || !(error instanceof GaussianSplatError) ? error : notOnnx(source, head, error);
  }
  if (!draft.hasGraph || draft.irVersion < 1) throw notOnnx(source, head);
  return headerOf(draft, source);
}

const emptyDraft = (): Draft => ({
  irVersion: 0,
  producerName: '',
  producerVersion: '',
  graphName: '',
  hasGraph: false,
  opsets: new Map(),
  metadata: new Map(),
  inputs: [],
  outputs: [],
  operators: new Map(),
  functions: new Set(),
  initializers: new Set(),
  externalFiles: new Map(),
  nodes: [],
  stored: new Map(),
  values: new Map(),
  initializerBytes: 0,
});

/**
 * Whether a file may be a model. Every exporter writes the IR version first, and random bytes rarely contain a
 * plausible one.
 */
const looksLikeModel = ({ irVersion }: Draft): boolean => irVersion >= 1 && irVersion < 100;

async function readModel(bytes: LoadedBytes, draft: Draft): Promise<void> {
  const field = new FieldCursor(bytes, { start: 0, end: bytes.size });
  const readUpToGraph = (): boolean => {
    if (field.number === 7 && field.isDelimited) return true;
    readModelField(bytes, field, draft);
    return false;
  };
  while (await readFields(bytes, field, readUpToGraph)) {
    draft.hasGraph = true;
    const inner = new FieldCursor(bytes, field);
    await readFields(bytes, inner, () => readGraphField(bytes, inner, draft));
  }
}

/**
 * Calls `read` for each field of a message. If bytes of a field are missing, they are loaded and the call is repeated.
 * @param read Reads the current field. Returns true to stop after it.
 * @returns Whether `read` stopped the iteration; false at the end of the message.
 */
async function readFields(bytes: LoadedBytes, field: FieldCursor, read: () => boolean | void): Promise<boolean> {
  let isPending = false;
  for (;;) {
    try {
      for (;;) {
        if (!isPending && !field.next()) return false;
        isPending = true;
        const isStopped = read();
        isPending = false;
        bytes.forget(field.offset);
        if (isStopped) return true;
      }
    } catch (missing) {
      if (!(missing instanceof NotLoaded)) throw missing;
      await bytes.load(missing.offset);
    }
  }
}

function readModelField(bytes: LoadedBytes, field: FieldCursor, draft: Draft): void {
  if (field.isVarint) {
    if (field.number === 1) draft.irVersion = field.value;
    return;
  }
  if (!field.isDelimited) return;
  switch (field.number) {
    case 2:
      draft.producerName = field.text(NAME_LIMIT);
      break;
    case 3:
      draft.producerVersion = field.text(NAME_LIMIT);
      break;
    case 8: {
      const [domain, version] = readOpset(bytes, field);
      draft.opsets.set(domain, version);
      break;
    }
    case 14:
      readEntry(bytes, field, draft.metadata, METADATA_LIMIT);
      break;
    case 25: {
      const harvest = emptyHarvest();
      const name = readFunction(bytes, field, harvest);
      draft.functions.add(name);
      keep(draft, harvest);
      break;
    }
  }
}

function readGraphField(bytes: LoadedBytes, field: FieldCursor, draft: Draft): void {
  if (!field.isDelimited) return;
  const harvest = emptyHarvest();
  switch (field.number) {
    case 1:
      readNode(bytes, field, harvest);
      break;
    case 2:
      draft.graphName = field.text(NAME_LIMIT);
      break;
    case 5:
      harvest.initializers.push(readTensor(bytes, field, harvest).name);
      break;
    case 15:
      harvest.initializers.push(readSparseTensor(bytes, field, harvest));
      break;
    case 11:
      draft.inputs.push(readValueInfo(bytes, field));
      break;
    case 12:
      draft.outputs.push(readValueInfo(bytes, field));
      break;
    case 13: {
      const value = readValueInfo(bytes, field);
      draft.values.set(value.name, value);
      break;
    }
  }
  keep(draft, harvest);
}

function keep(draft: Draft, harvest: Harvest): void {
  const { operators, initializers, externalFiles, initializerBytes } = harvest;
  // Not `push(...nodes)`: a call has at most about 100,000 arguments.
  for (const node of harvest.nodes) draft.nodes.push(node);
  for (const [name, value] of harvest.stored) if (name !== '') draft.stored.set(name, value);
  for (const name of operators) draft.operators.set(name, (draft.operators.get(name) ?? 0) + 1);
  for (const name of initializers) draft.initializers.add(name);
  for (const { location, byteLength } of externalFiles) {
    const known = draft.externalFiles.get(location)?.byteLength ?? 0;
    draft.externalFiles.set(location, { location, byteLength: Math.max(known, byteLength) });
  }
  draft.initializerBytes += initializerBytes;
}

function headerOf(draft: Draft, { name, size }: ByteSource): OnnxHeader {
  return {
    name,
    byteLength: size,
    irVersion: draft.irVersion,
    producer: [draft.producerName, draft.producerVersion].filter(Boolean).join(' '),
    graphName: draft.graphName,
    opsets: draft.opsets,
    metadata: draft.metadata,
    inputs: draft.inputs.filter((input) => !draft.initializers.has(input.name)),
    optionalInputs: draft.inputs.map(({ name }) => name).filter((name) => draft.initializers.has(name)),
    outputs: draft.outputs,
    operators: draft.operators,
    nodes: draft.nodes,
    stored: draft.stored,
    values: draft.values,
    functions: draft.functions,
    externalFiles: [...draft.externalFiles.values()],
    initializerBytes: draft.initializerBytes,
  };
}

function notOnnx(source: ByteSource, head: Uint8Array, cause?: GaussianSplatError): GaussianSplatError {
  const hex = Array.from(head.subarray(0, 8), (byte) => byte.toString(16).padStart(2, '0')).join(' ');
  return new GaussianSplatError('decode/unknown-format', {
    where: `${source.name} (${source.size} bytes)`,
    expected: 'an ONNX model: an IR version, then a graph',
    found: cause ? `bytes that begin with ${hex}` : 'neither in these bytes, which begin with ' + hex,
    remedy: 'give an ONNX file, as torch.onnx.export writes it',
    cause,
  });
}
