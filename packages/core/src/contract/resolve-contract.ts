import type { OnnxHeader } from '../onnx/header.js';
import type { Contract } from './contract.js';
import { inferContract } from './infer.js';
import { parseContract } from './parse-contract.js';

/** Key of `metadata_props` under which an ONNX file carries its own contract, as JSON. */
export const CONTRACT_METADATA_KEY = 'gaussian_contract';

/** Where a contract came from. */
export type ContractSource = 'explicit' | 'sidecar' | 'metadata' | 'inferred';

export interface ContractSources {
  readonly header: OnnxHeader;
  /** What the page or the caller gives: JSON text, or the object. */
  readonly explicit?: unknown;
  /** Content of the file beside the model that {@link sidecarName} names: JSON text, or the object. Needed only where {@link carriesContract} is false. */
  readonly sidecar?: unknown;
}

export interface ResolvedContract {
  readonly contract: Contract;
  readonly source: ContractSource;
  /** What was inferred, for a warning; empty where the contract was written. Sentences without a full stop. */
  readonly notes: readonly string[];
}

/**
 * The contract of a file: the explicit one, else what its metadata holds, else its sidecar, else inferred from canonical
 * names. The first that is there counts, even if it is wrong: a broken contract is never passed over in silence.
 * @throws ContractError with every fault of that contract's JSON; `contract/inference` where names say too little.
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

/** True if the file says itself what it is: no contract beside it is needed. */
export const carriesContract = ({ metadata }: OnnxHeader): boolean => metadata.has(CONTRACT_METADATA_KEY);

/** Name or address of a model's contract beside it: `NAME.contract.json` for `NAME.onnx`; a query stays where it is. */
export function sidecarName(model: string): string {
  const [, path, rest] = /^([^?#]*)(.*)$/s.exec(model)!;
  return `${path.replace(/\.(onnx|ort)$/i, '')}.contract.json${rest}`;
}
