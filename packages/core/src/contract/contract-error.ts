import { GaussianSplatError, type ContractErrorCode, type ErrorData } from '../errors.js';

/** One thing that is wrong. Fields are phrases without a trailing full stop. */
export interface ContractFault {
  /** Stable code. */
  readonly code: ContractErrorCode;
  /** Name of the input or output in question; undefined if the fault is not about one. */
  readonly tensor?: string;
  /** Place in the contract or in the file, for readers. */
  readonly where: string;
  readonly expected: string;
  readonly found: string;
  /** What to do. */
  readonly remedy: string;
}

export interface ContractErrorData extends ErrorData {
  readonly faults: readonly ContractFault[];
}

/** Faults that the message of an error spells out; all of them are in its `faults`. */
const MESSAGE_FAULTS = 20;

/** Everything that is wrong between a file, its contract and its values. Code and phrases are those of the first fault. */
export class ContractError extends GaussianSplatError {
  override readonly name = 'ContractError';
  readonly faults: readonly ContractFault[];

  /** @param faults at least one. */
  constructor(faults: readonly ContractFault[]) {
    super(faults[0].code, faults[0]);
    this.faults = faults;
    if (faults.length > 1) {
      const lines = faults.slice(0, MESSAGE_FAULTS).map((fault) => `- ${describeFault(fault)}`);
      if (faults.length > MESSAGE_FAULTS) lines.push(`- and ${faults.length - MESSAGE_FAULTS} more`);
      this.message = `${faults.length} faults:\n${lines.join('\n')}`;
    }
  }

  override toData(): ContractErrorData {
    return { ...super.toData(), faults: this.faults };
  }

  static override fromData(data: ContractErrorData): ContractError {
    return new ContractError(data.faults);
  }
}

/** A fault as one line. */
export function describeFault({ code, where, expected, found, remedy }: ContractFault): string {
  return `${where}: expected ${expected}, found ${found}. ${remedy.charAt(0).toUpperCase()}${remedy.slice(1)}. [${code}]`;
}
