import { ContractError, type ContractFault } from './contract-error.js';
import type { Contract, InputBinding, OutputBinding } from './contract.js';
import { CONTRACT_SCHEMA } from './schema.js';
import { describe, validate } from './validate.js';

/** The supported version of the contract. */
export const CONTRACT_VERSION = 1;

/**
 * Parses and validates a contract.
 *
 * @param json JSON text of the contract, or the parsed value.
 * @param where Name of the contract in messages, for example a file name.
 * @throws ContractError with every fault: `contract/json`, `contract/version`, `contract/schema`, `contract/conflict`.
 */
export function parseContract(json: unknown, where = 'contract'): Contract {
  const value = typeof json === 'string' ? parseJson(json, where) : json;
  const version = (value as { version?: unknown } | null)?.version;
  if (typeof version === 'number' && version !== CONTRACT_VERSION)
    throw new ContractError([unknownVersion(version, where)]);
  const faults = validate(value, CONTRACT_SCHEMA, where);
  if (faults.length > 0) throw new ContractError(faults);
  const contract = value as Contract;
  const conflicts = conflictsOf(contract, where);
  if (conflicts.length > 0) throw new ContractError(conflicts);
  return contract;
}

function parseJson(text: string, where: string): unknown {
  try {
    return JSON.parse(text.replace(/^\ufeff/, ''));
  } catch (error) {
    const isPage = /^\s*</.test(text);
    throw new ContractError([
      {
        code: 'contract/json',
        where,
        expected: 'a contract in JSON',
        found: isPage ? 'a web page (HTML or XML)' : `text that is none (${(error as Error).message})`,
        remedy: isPage ? 'check the address; the server sent something else' : 'correct the JSON',
      },
    ]);
  }
}

function unknownVersion(version: number, where: string): ContractFault {
  return {
    code: 'contract/version',
    where: `${where}.version`,
    expected: `${CONTRACT_VERSION}`,
    found: String(version),
    remedy:
      version > CONTRACT_VERSION
        ? 'update this library, or write the contract in version 1'
        : 'write the contract in version 1; see docs/contract.md',
  };
}

/** Returns the contradictions between fields that are each valid. */
function conflictsOf(contract: Contract, where: string): ContractFault[] {
  const conflict = (place: string, expected: string, found: string, remedy: string): ContractFault => ({
    code: 'contract/conflict',
    where: `${where}.${place}`,
    expected,
    found,
    remedy,
  });
  return [
    ...Object.entries(contract.inputs).flatMap(([name, binding]) =>
      inputConflicts(binding, contract).map(([field, expected, found, remedy]) =>
        conflict(`inputs.${name}${field && `.${field}`}`, expected, found, remedy),
      ),
    ),
    ...columnConflicts(contract.outputs).map(([field, expected, found, remedy]) =>
      conflict(`outputs.${field}`, expected, found, remedy),
    ),
    ...repeatedRoles(contract).map(([place, expected, found]) =>
      conflict(place, expected, found, 'keep one of them, and compute the other in the model'),
    ),
    ...repeatedTensors(contract.outputs).map(([field, other]) =>
      conflict(`outputs.${field}`, 'a separate output', `the output that ${other} names, too`, 'name another output'),
    ),
    ...boundsConflicts(contract).map((axis) =>
      conflict(`bounds`, `min at or below max on axis ${axis}`, 'min above max', 'exchange the two'),
    ),
  ];
}

type Conflict = readonly [field: string, expected: string, found: string, remedy: string];

function inputConflicts(binding: InputBinding, { duration }: Contract): Conflict[] {
  switch (binding.role) {
    case 'time':
      return binding.unit === 'normalized' && duration === undefined
        ? [['unit', 'a duration, because time is normalized', 'no duration', 'declare duration in seconds']]
        : [];
    case 'control':
      return controlConflicts(binding);
    case 'pose':
      return skeletonConflicts(binding);
    default:
      return [];
  }
}

function controlConflicts({ range: [min, max], default: initial }: InputBinding & { role: 'control' }): Conflict[] {
  if (!(min <= max)) return [['range', 'the smallest value first', describe([min, max]), 'exchange the two']];
  const outside = [initial].flat().find((value) => value < min || value > max);
  return outside === undefined
    ? []
    : [['default', `a value within ${min}..${max}`, String(outside), 'widen the range or change the default']];
}

function skeletonConflicts({ joints, parents }: InputBinding & { role: 'pose' }): Conflict[] {
  if (parents && joints && parents.length !== joints.length) {
    return [
      ['parents', `one for each of ${joints.length} joints`, `${parents.length}`, 'list as many parents as joints'],
    ];
  }
  const wrong = parents?.findIndex((parent, joint) => parent >= joint) ?? -1;
  return wrong < 0
    ? []
    : [
        [
          'parents',
          'parents before their children',
          `parent ${parents![wrong]} of joint ${wrong}`,
          'reorder the joints',
        ],
      ];
}

/** Returns the faults of `columns`, which must contain each attribute of a Gaussian exactly once. */
function columnConflicts(outputs: OutputBinding): Conflict[] {
  if (outputs.layout !== 'packed' || outputs.columns === undefined) return [];
  const { columns, color, scaleActivation, rotationOrder } = outputs;
  const tint = color === 'rgb' ? 'colors' : 'sh';
  const shape = columns.includes('covariances') ? ['covariances'] : ['scales', 'rotations'];
  const wanted = ['positions', ...shape, tint, 'opacities'];
  const isComplete = columns.length === wanted.length && wanted.every((name) => columns.includes(name as 'sh'));
  if (!isComplete) {
    const remedy = 'name each attribute of a row once, in its order';
    return [['columns', `${wanted.join(', ')}, in any order`, columns.join(', ') || 'none', remedy]];
  }
  const missing = [
    ...(shape.length === 2 && scaleActivation === undefined ? ['scaleActivation'] : []),
    ...(shape.length === 2 && rotationOrder === undefined ? ['rotationOrder'] : []),
  ];
  return missing.map((field) => [field, 'a value, because columns has scales and rotations', 'nothing', 'declare it']);
}

/**
 * Returns the inputs that repeat a role, which is a fault. Poses, shapes, controls, images and states may repeat, because
 * their names distinguish them; matrices may repeat in different conventions.
 */
function repeatedRoles({ inputs }: Contract): [place: string, expected: string, found: string][] {
  const seen = new Map<string, string>();
  return Object.entries(inputs).flatMap(([name, binding]) => {
    if (['pose', 'shape', 'control', 'image', 'state'].includes(binding.role)) return [];
    const role = binding.role === 'gaussians' ? `gaussians (${binding.attribute})` : binding.role;
    const first = seen.get(role);
    seen.set(role, name);
    // A matrix may be needed in two conventions.
    const isMatrix = ['view', 'camera_to_world', 'intrinsics', 'projection', 'view_projection'].includes(role);
    return first === undefined || isMatrix
      ? []
      : [[`inputs.${name}`, `one input with the role ${role}`, `${first} and ${name}`] as [string, string, string]];
  });
}

/** Returns each field of an output binding that names an output, with that name. */
export function tensorNames(outputs: OutputBinding): [field: string, tensor: string][] {
  const fields = [
    'gaussians',
    'positions',
    'covariances',
    'scales',
    'rotations',
    'colors',
    'sh',
    'opacities',
    'image',
    'count',
  ];
  const binding = outputs as unknown as Readonly<Record<string, string | undefined>>;
  return fields.flatMap((field) => {
    const tensor = binding[field];
    return tensor === undefined ? [] : [[field, tensor] as [string, string]];
  });
}

function repeatedTensors(outputs: OutputBinding): [field: string, other: string][] {
  const seen = new Map<string, string>();
  return tensorNames(outputs).flatMap(([field, tensor]) => {
    const first = seen.get(tensor);
    seen.set(tensor, field);
    return first === undefined ? [] : [[field, first] as [string, string]];
  });
}

function boundsConflicts({ bounds }: Contract): string[] {
  return bounds ? ['x', 'y', 'z'].filter((_, axis) => bounds.min[axis] > bounds.max[axis]) : [];
}
