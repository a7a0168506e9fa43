import { GaussianSplatError } from '@gaussian-splat/core';
import { partUrl } from '@gaussian-splat/core/fetch';
import {
  carriesContract,
  checkContract,
  ContractError,
  gaussianLayout,
  resolveContract,
  sidecarName,
  type Contract,
  type ContractFault,
  type GaussianLayout,
  type ResolvedContract,
} from '@gaussian-splat/core/contract';
import { openHeader, type ModelPlace, type OnnxHeader, type OpenedModel } from '@gaussian-splat/core/onnx';
import { fetchBytes, sumProgress, type FetchOptions, type ProgressListener } from './fetch-bytes.js';
import { modelOutputs, type ModelOutput } from './model-outputs.js';

/** Location of a generator. */
export interface ModelSource {
  /** Address of the ONNX file, absolute or relative to the page. */
  readonly url: string;
  /** The contract, as JSON text or as the object; default: that in the model's metadata, else a sidecar file. */
  readonly contract?: unknown;
  readonly credentials?: 'omit' | 'same-origin' | 'include';
  /**
   * Reads the header on another thread. It may transfer the bytes, and returns them as `whole`. Default: core's
   * `openHeader`.
   */
  readonly openHeader?: ((place: ModelPlace, signal?: AbortSignal) => Promise<OpenedModel>) | undefined;
}

/** A validated model with all of its bytes, but without any runtime. */
export interface GeneratorModel {
  readonly url: string;
  readonly header: OnnxHeader;
  readonly contract: Contract;
  /** Undefined for a post-processor, which writes an image. */
  readonly layout: GaussianLayout | undefined;
  /** All outputs that the contract names, each once. */
  readonly outputs: readonly ModelOutput[];
  /** Number of instances in a run; undefined if the model has no axis for them, or it is still symbolic. */
  readonly instances?: number;
  /** Inferences for a missing contract, for a warning; sentences without a full stop. */
  readonly notes: readonly string[];
  readonly bytes: Uint8Array;
  /** External files, by the locations in the model. */
  readonly externalData: readonly { readonly path: string; readonly data: Uint8Array }[];
}

/**
 * Fetches a model and checks it against its contract: first the header, and the weights only if that is valid.
 * @throws ContractError with every fault; GaussianSplatError `decode/*` for a file that is not an ONNX model,
 * `network/*`; the reason of the signal.
 */
export async function openModel(
  source: ModelSource,
  options: Pick<FetchOptions, 'signal' | 'onProgress'> = {},
): Promise<GeneratorModel> {
  const { credentials = 'same-origin', openHeader: open = openHeader } = source;
  const request = { credentials, signal: options.signal };
  // A worker's own address differs from the page's.
  const base = globalThis.location?.href;
  const address = URL.canParse(source.url, base) ? new URL(source.url, base).href : source.url;
  const { header, size, whole } = await open({ url: address, credentials }, options.signal);
  const { contract, notes } = await contractOf(source, header, request);
  const faults = checkContract(header, contract);
  if (faults.length > 0) throw new ContractError(faults);
  const layout = gaussianLayout(header, contract);
  const { externalFiles } = header;
  const reports = sumProgress(externalFiles.length + 1, options.onProgress ?? (() => undefined));
  // Known lengths are reported at the start, so that the sum has a total before the first bytes arrive.
  externalFiles.forEach(({ byteLength }, i) => reports[i](0, byteLength));
  reports[externalFiles.length](0, size);
  const externalData = await fetchExternal(source, header, contract, request, reports);
  const onProgress = reports[externalFiles.length];
  if (whole) onProgress(whole.length, whole.length);
  const fetched = whole ?? (await fetchBytes(source.url, { ...request, onProgress, expected: size }));
  // A file that was fetched in ranges may have been replaced meanwhile.
  const bytes = whole ?? (await open({ bytes: fetched, name: header.name }, options.signal)).whole ?? fetched;
  return {
    url: source.url,
    header,
    contract,
    layout,
    outputs: modelOutputs(header, contract, layout),
    notes,
    bytes,
    externalData,
  };
}

/** Maximum size of a contract, which has some kilobytes including a rest pose. */
const MAX_CONTRACT_BYTES = 1 << 20;

const longContract = (where: string, found: number): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    where: `${where}, the contract beside it`,
    expected: `at most ${MAX_CONTRACT_BYTES} bytes`,
    found: String(found),
    remedy: 'write the contract without what no reader needs',
  });

async function contractOf(source: ModelSource, header: OnnxHeader, request: FetchOptions): Promise<ResolvedContract> {
  const explicit = source.contract;
  if (explicit !== undefined && explicit !== null) return resolveContract({ header, explicit });
  if (carriesContract(header)) return resolveContract({ header });
  if (/^(data|blob):/.test(source.url)) return resolveContract({ header });
  const bytes = await fetchBytes(sidecarName(source.url), { ...request, mayBeMissing: true });
  if (bytes && bytes.length > MAX_CONTRACT_BYTES) throw longContract(source.url, bytes.length);
  const text = bytes && new TextDecoder().decode(bytes);
  // Servers of single-page applications respond with their page for missing files.
  const sidecar = text === undefined || /^\s*</.test(text) ? undefined : text;
  return resolveContract({ header, sidecar });
}

/** Maximum number of weight files: exporters write one, or one for each large tensor on request. */
const MAX_FILES = 256;
/** Maximum number of concurrent downloads, so that other requests of the page can proceed. */
const FILES_AT_ONCE = 4;

function tooManyFiles({ name, externalFiles }: OnnxHeader): GaussianSplatError {
  return new GaussianSplatError('decode/unsupported', {
    where: name,
    expected: `at most ${MAX_FILES} files of weights beside a model`,
    found: String(externalFiles.length),
    remedy: 'write the weights into one file: onnx.save_model(model, path, save_as_external_data=True)',
  });
}

async function fetchExternal(
  source: ModelSource,
  header: OnnxHeader,
  contract: Contract,
  request: FetchOptions,
  reports: readonly ProgressListener[],
): Promise<GeneratorModel['externalData']> {
  if (header.externalFiles.length > MAX_FILES) throw tooManyFiles(header);
  const files: { path: string; data: Uint8Array<ArrayBuffer> | undefined }[] = [];
  let next = 0;
  const fetchSome = async (): Promise<void> => {
    for (let i = next++; i < header.externalFiles.length; i = next++) {
      const { location: path, byteLength: expected } = header.externalFiles[i];
      const address = partUrl(path, new URL(source.url, globalThis.location?.href)).href;
      const options = { ...request, expected, onProgress: reports[i], mayBeMissing: true } as const;
      files[i] = { path, data: await fetchBytes(address, options) };
    }
  };
  await Promise.all(Array.from({ length: FILES_AT_ONCE }, fetchSome));
  const found = files.filter(
    (file): file is { path: string; data: Uint8Array<ArrayBuffer> } => file.data !== undefined,
  );
  const sizes = new Map(found.map(({ path, data }) => [path, data.length]));
  const faults: ContractFault[] = files.length > 0 ? checkContract(header, contract, { files: sizes }) : [];
  if (faults.length > 0) throw new ContractError(faults);
  return found;
}
