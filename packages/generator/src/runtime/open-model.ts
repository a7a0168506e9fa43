import { GaussianSplatError } from '@gaussian-splat/core';
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
import { externalUrl, openHeader, type ModelPlace, type OnnxHeader, type OpenedModel } from '@gaussian-splat/core/onnx';
import { fetchBytes, sumProgress, type FetchOptions, type ProgressListener } from './fetch-bytes.js';
import { modelOutputs, type ModelOutput } from './model-outputs.js';

/** Source of a generator. */
export interface ModelSource {
  /** URL of the ONNX file, absolute or relative to the page. */
  readonly url: string;
  /** Contract, as JSON text or as an object. Default: the contract in the model's metadata, or in a sidecar file. */
  readonly contract?: unknown;
  readonly credentials?: 'omit' | 'same-origin' | 'include';
  /**
   * Reads the header on another thread. The function may transfer the bytes, and then returns them as `whole`. Default:
   * core's `openHeader`.
   */
  readonly openHeader?: ((place: ModelPlace, signal?: AbortSignal) => Promise<OpenedModel>) | undefined;
}

/** A validated model with all of its bytes. No runtime is needed yet. */
export interface GeneratorModel {
  readonly url: string;
  readonly header: OnnxHeader;
  readonly contract: Contract;
  /** Layout of the Gaussians; undefined for a post-processor, which writes an image. */
  readonly layout: GaussianLayout | undefined;
  /** Outputs that the contract names, each once. */
  readonly outputs: readonly ModelOutput[];
  /** Number of instances in a run; undefined if the model has no axis for instances, or its size is still symbolic. */
  readonly instances?: number;
  /** Assumptions made for a missing contract, for a warning; sentences without a full stop. */
  readonly notes: readonly string[];
  readonly bytes: Uint8Array;
  /** External files with weights. `path` is the location that the model declares. */
  readonly externalData: readonly { readonly path: string; readonly data: Uint8Array }[];
}

/**
 * Fetches a model and checks it against its contract. The weights are fetched only if the header is valid.
 * @throws ContractError with every fault; GaussianSplatError `decode/*` for a file that is not an ONNX model,
 * `network/*`; the reason of the signal.
 */
export async function openModel(
  source: ModelSource,
  options: Pick<FetchOptions, 'signal' | 'onProgress'> = {},
): Promise<GeneratorModel> {
  const { credentials = 'same-origin', openHeader: open = openHeader } = source;
  const request = { credentials, signal: options.signal };
  // The URL is resolved here, because a worker has another base URL than the page.
  const { header, size, whole } = await open({ url: addressOf(source.url), credentials }, options.signal);
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
  // Reads the header again, because a file that was fetched in ranges may have been replaced meanwhile.
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

/** Returns the absolute URL of a model; text that is no URL is returned as it is, for the error of the download. */
export function addressOf(url: string): string {
  const base = globalThis.location?.href;
  return URL.canParse(url, base) ? new URL(url, base).href : url;
}

/** Maximum size of a contract, bytes. Typical contracts have some kilobytes, including a rest pose. */
const MAX_CONTRACT_BYTES = 1 << 20;

const longContract = (where: string): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/budget', {
    where: `${where}, the contract beside it`,
    expected: `at most ${MAX_CONTRACT_BYTES} bytes`,
    found: 'more',
    remedy: 'remove unneeded texts from the contract',
  });

async function contractOf(source: ModelSource, header: OnnxHeader, request: FetchOptions): Promise<ResolvedContract> {
  const explicit = source.contract;
  if (explicit !== undefined && explicit !== null) return resolveContract({ header, explicit });
  if (carriesContract(header)) return resolveContract({ header });
  if (/^(data|blob):/.test(source.url)) return resolveContract({ header });
  let hidden: unknown;
  const asked = { ...request, mayBeMissing: true, maxBytes: MAX_CONTRACT_BYTES } as const;
  const bytes = await fetchBytes(sidecarName(source.url), asked).catch((error: unknown) => {
    if ((error as Error | undefined)?.cause instanceof RangeError) throw longContract(source.url);
    // Many servers permit other origins to read their files, but not their responses to unknown paths.
    const isOtherServer = new URL(addressOf(source.url)).origin !== globalThis.location?.origin;
    if (!isOtherServer || (error as { code?: string }).code !== 'network/unreachable') throw error;
    hidden = error;
    return undefined;
  });
  const text = bytes && new TextDecoder().decode(bytes);
  // Servers of single-page applications respond with their HTML page for missing files.
  const sidecar = text === undefined || /^\s*</.test(text) ? undefined : text;
  try {
    return resolveContract({ header, sidecar });
  } catch (error) {
    // A contract that cannot be read may be there.
    throw hidden ?? error;
  }
}

/** Maximum number of concurrent downloads, so that other requests of the page can proceed. */
const FILES_AT_ONCE = 4;

async function fetchExternal(
  source: ModelSource,
  header: OnnxHeader,
  contract: Contract,
  request: FetchOptions,
  reports: readonly ProgressListener[],
): Promise<GeneratorModel['externalData']> {
  const files: { path: string; data: Uint8Array<ArrayBuffer> | undefined }[] = [];
  let next = 0;
  const fetchSome = async (): Promise<void> => {
    for (let i = next++; i < header.externalFiles.length; i = next++) {
      const { location: path, byteLength: expected } = header.externalFiles[i];
      const address = externalUrl(path, addressOf(source.url));
      const options = { ...request, expected, onProgress: reports[i], mayBeMissing: true } as const;
      files[i] = { path, data: address && (await fetchBytes(address.href, options)) };
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
