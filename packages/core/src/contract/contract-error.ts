import { GaussianSplatError, type ContractErrorCode, type ErrorData, type ErrorDetails } from '../errors.js';
import { clipped } from './validate.js';

/** One fault of a file, its contract or its outputs. Texts are phrases without a trailing full stop. */
export interface ContractFault {
  readonly code: ContractErrorCode;
  /** Name of the input or output; undefined if the fault does not concern a single one. */
  readonly tensor?: string;
  /** Location in the contract or in the file, for display. */
  readonly where: string;
  readonly expected: string;
  readonly found: string;
  /** Suggested correction. */
  readonly remedy: string;
}

export interface ContractErrorData extends ErrorData {
  readonly faults: readonly ContractFault[];
}

/** Maximum number of faults in the message of a {@link ContractError}; its `faults` contain all. */
const MESSAGE_FAULTS = 20;

/** All faults of a file, its contract or its outputs. The code and the texts of the error are those of the first fault. */
export class ContractError extends GaussianSplatError {
  override readonly name = 'ContractError';
  readonly faults: readonly ContractFault[];

  /** @param faults One or more faults. */
  constructor(faults: readonly ContractFault[]) {
    super(faults[0].code, shortened(faults[0]));
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

/** Formats a fault as one line. */
export function describeFault(fault: ContractFault): string {
  const { where, expected, found, remedy } = shortened(fault);
  return `${where}: expected ${expected}, found ${found}. ${remedy.charAt(0).toUpperCase()}${remedy.slice(1)}. [${fault.code}]`;
}

/** Returns the texts of a fault with 1,000 characters at most, because they contain names of the file. */
function shortened({ where, expected, found, remedy }: ContractFault): ErrorDetails {
  const [a, b, c, d] = [where, expected, found, remedy].map((text) => clipped(text, 1000));
  return { where: a, expected: b, found: c, remedy: d };
}
