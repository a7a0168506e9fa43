import type { OnnxHeader } from '../onnx/header.js';
import type { Contract } from './contract.js';
import { inferContract } from './infer.js';
import { parseContract } from './parse-contract.js';

/** Key of `metadata_props` under which an ONNX file contains its own contract, as JSON. */
export const CONTRACT_METADATA_KEY = 'gaussian_contract';

/** Source of a contract. */
export type ContractSource = 'explicit' | 'sidecar' | 'metadata' | 'inferred';

export interface ContractSources {
  readonly header: OnnxHeader;
  /** Contract of the page or the caller: JSON text, or the object. */
  readonly explicit?: unknown;
  /**
   * Content of the file beside the model that {@link sidecarName} names: JSON text, or the object. Needed only if
   * {@link carriesContract} is false.
   */
  readonly sidecar?: unknown;
}

export interface ResolvedContract {
  readonly contract: Contract;
  readonly source: ContractSource;
  /** Inferences, for a warning; empty for a written contract. Sentences without a full stop. */
  readonly notes: readonly string[];
}

/**
 * Returns the contract of a file: the explicit one, else that of its metadata, else its sidecar, else one inferred from
 * canonical names. The first available one is used, even if it is invalid: a broken contract is never ignored silently.
 * @throws ContractError with every fault of that contract's JSON; `contract/inference` if the names are ambiguous.
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

/** Returns the name or address of a model's sidecar: `NAME.contract.json` for `NAME.onnx`; a query is kept. */
export function sidecarName(model: string): string {
  const [, path, rest] = /^([^?#]*)(.*)$/s.exec(model)!;
  return `${path.replace(/\.(onnx|ort)$/i, '')}.contract.json${rest}`;
}
