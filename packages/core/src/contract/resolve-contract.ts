import type { OnnxHeader } from '../onnx/header.js';
import type { Contract } from './contract.js';
import { inferContract } from './infer.js';
import { parseContract } from './parse-contract.js';

/** Key of `metadata_props` under which an ONNX file contains its own contract, as JSON. */
export const CONTRACT_METADATA_KEY = 'gaussian_contract';

/** Source of a contract: the caller, a file beside the model, the model's metadata, or inference from names. */
export type ContractSource = 'explicit' | 'sidecar' | 'metadata' | 'inferred';

export interface ContractSources {
  readonly header: OnnxHeader;
  /** Contract of the caller: JSON text, or the parsed object. */
  readonly explicit?: unknown;
  /**
   * Content of the file beside the model that {@link sidecarName} names: JSON text, or the parsed object. Needed only if
   * {@link carriesContract} returns false.
   */
  readonly sidecar?: unknown;
}

export interface ResolvedContract {
  readonly contract: Contract;
  readonly source: ContractSource;
  /** Assumptions of an inferred contract, for a warning: sentences without a full stop. Empty for other sources. */
  readonly notes: readonly string[];
}

/**
 * Returns the contract of a file from the first available source: the caller, the file's metadata, its sidecar, or
 * inference from names. An invalid contract throws, and later sources are not tried.
 * @throws ContractError with all faults of the contract's JSON; `contract/inference` if the names are ambiguous.
 */
export function resolveContract({ header, explicit, sidecar }: ContractSources): ResolvedContract {
  const written = (source: ContractSource, json: unknown, where: string): ResolvedContract => ({
    contract: parseContract(json, where),
    source,
    notes: [],
  });
  if (explicit !== undefined && explicit !== null) return written('explicit', explicit, 'contract');
  const embedded = header.metadata.get(CONTRACT_METADATA_KEY);
  if (embedded !== undefined) return written('metadata', embedded, `metadata ${CONTRACT_METADATA_KEY}`);
  if (sidecar !== undefined && sidecar !== null) return written('sidecar', sidecar, sidecarName(header.name));
  return { source: 'inferred', ...inferContract(header) };
}

/** Whether the file contains its contract, so that no sidecar is needed. */
export const carriesContract = ({ metadata }: OnnxHeader): boolean => metadata.has(CONTRACT_METADATA_KEY);

/** Returns the path of a model's sidecar: `NAME.contract.json` for `NAME.onnx`. */
export const sidecarPath = (model: string): string => `${model.replace(/\.(onnx|ort)$/i, '')}.contract.json`;

/** Returns the address of a model's sidecar, which has the query of the model. */
export function sidecarName(model: string): string {
  const [, path, rest] = /^([^?#]*)(.*)$/s.exec(model)!;
  return sidecarPath(path) + rest;
}
