/**
 * The JSON Schema of contracts: the single definition of valid contract JSON, which `parseContract` applies.
 * contract.schema.json is a copy for other languages (`node scripts/write-contract-schema.mjs`).
 */
import { SPLAT_FILTERS, type SplatFilter } from '../gaussian-cloud.js';

/** A schema, with the keywords of JSON Schema (draft 2020-12) that the contract uses. */
export interface Schema {
  readonly $schema?: string;
  readonly $id?: string;
  readonly title?: string;
  readonly description?: string;
  readonly type?: 'object' | 'array' | 'string' | 'number' | 'integer' | 'boolean';
  readonly const?: string | number;
  readonly enum?: readonly string[];
  readonly minLength?: number;
  readonly minimum?: number;
  readonly maximum?: number;
  readonly exclusiveMinimum?: number;
  readonly items?: Schema;
  readonly minItems?: number;
  readonly maxItems?: number;
  readonly properties?: Readonly<Record<string, Schema>>;
  readonly additionalProperties?: Schema | false;
  readonly required?: readonly string[];
  readonly dependentRequired?: Readonly<Record<string, readonly string[]>>;
  /**
   * Alternatives: exactly one must match. Either a property with `const` distinguishes them, or each has only
   * `required`.
   */
  readonly oneOf?: readonly Schema[];
  readonly anyOf?: readonly Schema[];
  readonly allOf?: readonly Schema[];
  readonly if?: Schema;
  readonly then?: Schema;
}

const text = (description: string): Schema => ({ type: 'string', minLength: 1, description });
const choice = (description: string, ...values: string[]): Schema => ({ type: 'string', enum: values, description });
const positive = (description: string): Schema => ({ type: 'number', exclusiveMinimum: 0, description });
const numbers = (description: string, length?: number): Schema => ({
  type: 'array',
  items: { type: 'number' },
  ...(length === undefined ? {} : { minItems: length, maxItems: length }),
  description,
});
const texts = (description: string): Schema => ({ type: 'array', items: { type: 'string' }, description });

/** Returns a rule that requires the other properties if `key` has this value. */
const requiredWhere = (key: string, value: string, ...others: string[]): Schema => ({
  if: { properties: { [key]: { const: value } }, required: [key] },
  then: { required: others },
});
const exactlyOne = (...keys: string[]): Schema => ({ oneOf: keys.map((key) => ({ required: [key] })) });

const output = (what: string): Schema => text(`Name of the output ${what}`);

const order = choice('Layout of the matrix in the tensor; default row-major', 'row-major', 'column-major');
const axes = choice(
  'Directions of the x, y and z axes of the camera (left/right, up/down, forward/back); default RDF, as in OpenCV',
  ...['RDF', 'RDB', 'RUF', 'RUB', 'LDF', 'LDB', 'LUF', 'LUB'],
);
const opacityActivation = choice('Form of the opacities: 0..1, or before the sigmoid', 'linear', 'logit');
const scaleActivation = choice('Form of the scales: standard deviations, or their logarithms', 'linear', 'log');
const quaternionOrder = choice('Order of the numbers of a quaternion', 'wxyz', 'xyzw');
const shOrder = choice(
  'Red, green and blue innermost ([(d+1)^2, 3]), or coefficients innermost ([3, (d+1)^2])',
  'coefficient-major',
  'channel-major',
);
const color = choice('Content of the color columns', 'rgb', 'sh');
const count = output('[1] int32 or int64 with the number of valid rows');

function variant(
  key: 'role' | 'layout',
  value: string,
  description: string,
  properties: Readonly<Record<string, Schema>> = {},
  rules: Pick<Schema, 'required' | 'dependentRequired' | 'allOf'> = {},
): Schema {
  return {
    type: 'object',
    description,
    properties: { [key]: { const: value }, ...properties },
    additionalProperties: false,
    ...rules,
    required: [key, ...(rules.required ?? [])],
  };
}

const input: Schema = {
  description: 'Meaning of one input of the ONNX file',
  oneOf: [
    variant('role', 'view', '[4,4] or [16], float32: world to camera', { order, axes }),
    variant('role', 'camera_to_world', '[4,4] or [16], float32: camera to world, the inverse of view', { order, axes }),
    variant(
      'role',
      'intrinsics',
      '[3,3] float32, row-major, or [4]: fx, fy, cx, cy',
      { unit: choice('Pixels, or fractions of width and height', 'pixels', 'normalized') },
      { required: ['unit'] },
    ),
    variant('role', 'projection', '[4,4] or [16], float32: camera to clip, depth 0..1', { order, axes }),
    variant('role', 'view_projection', '[4,4] or [16], float32: world to clip, depth 0..1', { order }),
    variant('role', 'camera_position', '[3] float32: the eye in world units'),
    variant('role', 'viewport', '[2] float32: width and height in pixels'),
    variant(
      'role',
      'time',
      'One float32',
      { unit: choice('Seconds, or a fraction 0..1 of the duration', 'seconds', 'normalized') },
      { required: ['unit'] },
    ),
    variant('role', 'frame', 'One int32 or int64: index of a frame'),
    variant('role', 'seed', 'One int32 or int64: seed of random numbers'),
    variant(
      'role',
      'pose',
      '[J,3] axis-angle, [J,4] quaternions, [J,3,3] matrices, any of them flat, or [P] parameters; float32',
      {
        format: choice('Format of the pose', 'axis-angle', 'quaternion', 'matrix', 'parameters'),
        quaternionOrder,
        joints: texts('Names of the joints, in the order of the tensor'),
        parents: {
          type: 'array',
          items: { type: 'integer', minimum: -1 },
          description: 'For each joint the index of its parent, -1 for roots',
        },
        default: numbers('Pose at rest, flattened'),
      },
      { required: ['format'], allOf: [requiredWhere('format', 'quaternion', 'quaternionOrder')] },
    ),
    variant('role', 'shape', '[B] float32: coefficients of a body or an expression', {
      names: texts('Names of the coefficients'),
      default: numbers('Initial coefficients; default zeros'),
    }),
    variant(
      'role',
      'control',
      'Any fixed shape of float32, int32 or int64: a control for visitors',
      {
        range: numbers('Smallest and largest value', 2),
        default: {
          anyOf: [{ type: 'number' }, numbers('All elements, flattened')],
          description: 'Initial value: one number for all elements, or a list of all of them',
        },
        step: positive('Step between values'),
        label: text('Name for readers'),
      },
      { required: ['range', 'default'] },
    ),
    variant(
      'role',
      'gaussians',
      'Gaussians of the generator before this one in a chain',
      {
        attribute: choice(
          'Tensor of the layout that this input takes',
          ...['packed', 'positions', 'covariances', 'scales', 'rotations', 'colors', 'sh', 'opacities', 'count'],
        ),
        color,
        opacityActivation,
        scaleActivation,
        rotationOrder: quaternionOrder,
        shOrder,
      },
      {
        required: ['attribute'],
        allOf: [
          requiredWhere('attribute', 'packed', 'color', 'opacityActivation'),
          requiredWhere('attribute', 'opacities', 'opacityActivation'),
          requiredWhere('attribute', 'scales', 'scaleActivation'),
          requiredWhere('attribute', 'rotations', 'rotationOrder'),
          requiredWhere('attribute', 'sh', 'shOrder'),
          requiredWhere('color', 'sh', 'shOrder'),
        ],
      },
    ),
    variant(
      'role',
      'state',
      'Output of the previous run: any fixed shape of float32, float16 or int32',
      { output: output('that the next run takes'), default: { type: 'number', description: 'Before the first run' } },
      { required: ['output'] },
    ),
    variant(
      'role',
      'image',
      '[1,3,H,W] float32 or float16: red, green and blue planes in 0..1; [1,4,H,W] with alpha, [V,3,H,W] of V images',
    ),
    variant(
      'role',
      'depth',
      '[1,1,H,W] float32 or float16, of a post-processor: depth along the axis of the camera in world units at which the transmittance falls to 0.5; 0 if it never does',
    ),
  ],
};

const outputs: Schema = {
  description: 'Tensors and layout of the Gaussians',
  oneOf: [
    variant(
      'layout',
      'packed',
      'One tensor [N, D]: position 3, covariance 6, color 3 or harmonics 3(d+1)^2, opacity 1; or in the order of columns',
      {
        gaussians: output('with all columns'),
        color,
        opacityActivation,
        shOrder,
        columns: {
          type: 'array',
          items: choice(
            'An attribute',
            ...['positions', 'covariances', 'scales', 'rotations', 'colors', 'sh', 'opacities'],
          ),
          description: 'Attributes of a row, in order',
        },
        scaleActivation,
        rotationOrder: quaternionOrder,
        count,
      },
      { required: ['gaussians', 'color', 'opacityActivation'], allOf: [requiredWhere('color', 'sh', 'shOrder')] },
    ),
    variant(
      'layout',
      'split',
      'One tensor for each attribute',
      {
        positions: output('[N,3] of centers'),
        covariances: output('[N,6] of covariances xx, xy, xz, yy, yz, zz, or [N,3,3]'),
        scales: output('[N,3] of scales, or [N,1] for all three axes'),
        scaleActivation,
        rotations: output('[N,4] of quaternions'),
        rotationOrder: quaternionOrder,
        colors: output('[N,3] of colors in 0..1, or [N,4], whose fourth is not read'),
        sh: output('of spherical harmonics, [N,(d+1)^2,3] or [N,3,(d+1)^2]'),
        shOrder,
        opacities: output('[N] or [N,1] of opacities'),
        opacityActivation,
        count,
      },
      {
        required: ['positions', 'opacities', 'opacityActivation'],
        dependentRequired: {
          scales: ['rotations', 'scaleActivation'],
          rotations: ['scales', 'rotationOrder'],
          sh: ['shOrder'],
        },
        allOf: [exactlyOne('covariances', 'scales'), exactlyOne('colors', 'sh')],
      },
    ),
    variant(
      'layout',
      'visionary',
      'Two tensors, as in Visionary: [N,10] position, opacity, covariance; and colors or harmonics',
      {
        gaussians: output('[N,10]'),
        colors: output('[N,4] or [N,3] of colors'),
        sh: output('[N,3(d+1)^2] of harmonics'),
        count,
      },
      { required: ['gaussians'], allOf: [exactlyOne('colors', 'sh')] },
    ),
    variant(
      'layout',
      'image',
      'A post-processor',
      { image: output('[1,3,H,W] of red, green and blue planes in 0..1') },
      { required: ['image'] },
    ),
  ],
};

/** JSON Schema (draft 2020-12) of contracts of version 1. */
export const CONTRACT_SCHEMA: Schema = {
  $schema: 'https://json-schema.org/draft/2020-12/schema',
  $id: 'urn:gaussian-splat:contract:1',
  title: 'Gaussian Generator contract, version 1',
  description: 'Meaning of the inputs of an ONNX file, and the layout of the Gaussians that it writes',
  type: 'object',
  properties: {
    $schema: text('Address of this schema'),
    version: { const: 1, description: 'Version of the contract' },
    name: text('Name for readers'),
    inputs: {
      type: 'object',
      additionalProperties: input,
      description: 'The role of each input of the ONNX file, by its name',
    },
    outputs,
    nMax: { type: 'integer', minimum: 1, description: 'Maximum number of Gaussians that one run writes' },
    instances: {
      type: 'object',
      properties: {
        axis: text('Name of the symbolic first dimension of outputs, and of inputs that may differ'),
        most: { type: 'integer', minimum: 1, description: 'Maximum number of instances in one run' },
      },
      required: ['axis', 'most'],
      additionalProperties: false,
      description: 'Declared by a model that computes several instances in one run',
    },
    dtype: choice('Element type of the Gaussian outputs', 'float32', 'float16'),
    shDegree: { type: 'integer', minimum: 0, maximum: 3, description: 'Degree of the spherical harmonics' },
    bounds: {
      type: 'object',
      properties: {
        min: numbers('Smallest x, y and z in world units', 3),
        max: numbers('Largest x, y and z in world units', 3),
      },
      required: ['min', 'max'],
      additionalProperties: false,
      description: 'Box around all centers at all times, with controls, poses and shapes at their defaults',
    },
    duration: positive('Duration of the input time or frame in seconds'),
    fps: positive('Frames per second of the input frame'),
    coordinates: {
      type: 'object',
      properties: {
        up: choice('The axis that points up; default -y', '+x', '-x', '+y', '-y', '+z', '-z'),
        handedness: choice('Handedness of the world; default right', 'right', 'left'),
        metresPerUnit: positive('Meters per world unit'),
      },
      additionalProperties: false,
      description: 'Coordinate system of the Gaussians',
    },
    antialiased: {
      type: 'boolean',
      description: 'Trained with opacity compensation for the low-pass filter; default false',
    },
    filter: choice(
      'Low-pass filter of the training, instead of antialiased: 0.3 px², 0.3 with compensation, 0.1 with compensation',
      ...(Object.keys(SPLAT_FILTERS) as SplatFilter[]),
    ),
    license: text('SPDX identifier, or a few words'),
    attribution: text('Names for the attribution'),
  },
  required: ['version', 'inputs', 'outputs'],
  additionalProperties: false,
};
