import type { ShDegree, SplatFilter } from '../gaussian-cloud.js';
import type { Vector3 } from '../vector.js';

/**
 * A Gaussian Generator contract, version 1: what an ONNX file's inputs mean and how its outputs are written. Published
 * wording, with examples: docs/contract.md; as JSON Schema: contract.schema.json.
 */
export interface Contract {
  /** Address of the JSON Schema, for editors; not read. */
  readonly $schema?: string;
  readonly version: 1;
  /** Name for readers. */
  readonly name?: string;
  /** What each input of the ONNX file means, by its name. A file without inputs has none: `{}`. */
  readonly inputs: Readonly<Record<string, InputBinding>>;
  /** Where and how the Gaussians are written. */
  readonly outputs: OutputBinding;
  /** Most Gaussians that one run writes: needed where the file leaves their number N symbolic. With a `count` it may be less than N: rows behind it are padding. */
  readonly nMax?: number;
  /** Declared by a model that computes several instances of itself in one run. */
  readonly instances?: Instances;
  /** Element type of the Gaussian outputs. The file says it too; declared here it is checked. */
  readonly dtype?: 'float32' | 'float16';
  /** Degree of the spherical harmonics. The shape says it too; declared here it is checked. */
  readonly shDegree?: ShDegree;
  /** Box around all centres at all times, in world units, with controls, poses and shapes at their defaults. */
  readonly bounds?: { readonly min: Vector3; readonly max: Vector3 };
  /** Length in seconds of what the input `time` or `frame` plays. */
  readonly duration?: number;
  /** Frames to a second of what the input `frame` counts. */
  readonly fps?: number;
  readonly coordinates?: Coordinates;
  /** True if trained with opacity compensation for the screen-space dilation (Mip-Splatting style). Default false. */
  readonly antialiased?: boolean;
  /** The screen-space low-pass filter that it was trained with; counts in place of `antialiased`. */
  readonly filter?: SplatFilter;
  /** SPDX identifier, or a few words. */
  readonly license?: string;
  /** Who is to be named. */
  readonly attribution?: string;
}

/**
 * A symbolic axis that stands first in every Gaussian output, in the count, and in those inputs that may differ from instance to instance.
 * Behind it shapes are those of one instance, with N fixed. Inputs without it are the same for all instances of a run.
 */
export interface Instances {
  /** Name of the symbolic dimension in the file. */
  readonly axis: string;
  /** Most instances that one run takes. */
  readonly most: number;
}

/** The frame that Gaussians are written in. Default: y down, right-handed, the trainers' frame; units unknown. */
export interface Coordinates {
  readonly up?: '+x' | '-x' | '+y' | '-y' | '+z' | '-z';
  readonly handedness?: 'right' | 'left';
  /** Metres to one world unit. */
  readonly metresPerUnit?: number;
}

/** How the 16 numbers of a matrix that acts on column vectors are laid out in the tensor; default `row-major`, as PyTorch reads it. */
export type MatrixOrder = 'row-major' | 'column-major';

/**
 * Where the camera's x, y and z axes point: left or right, up or down, forward or back. `RDF` is OpenCV's and the
 * default, `RUB` OpenGL's, `LUF` PyTorch3D's and Visionary's.
 */
export type CameraAxes = 'RDF' | 'RDB' | 'RUF' | 'RUB' | 'LDF' | 'LDB' | 'LUF' | 'LUB';

/** Order of the four numbers of a quaternion. */
export type QuaternionOrder = 'wxyz' | 'xyzw';

/** Whether red, green and blue are innermost ([(d+1)², 3]), or the coefficients ([3, (d+1)²], as in INRIA's PLY files). */
export type ShOrder = 'coefficient-major' | 'channel-major';

/** [4,4] float32: world to camera. */
export interface ViewInput {
  readonly role: 'view';
  readonly order?: MatrixOrder;
  readonly axes?: CameraAxes;
}

/** [4,4] float32: camera to world, the inverse of `view`; its last column is the eye. */
export interface CameraToWorldInput {
  readonly role: 'camera_to_world';
  readonly order?: MatrixOrder;
  readonly axes?: CameraAxes;
}

/** [3,3] float32, row-major: fx 0 cx, 0 fy cy, 0 0 1; or [4]: fx, fy, cx, cy. */
export interface IntrinsicsInput {
  readonly role: 'intrinsics';
  /** `normalized`: focal lengths and principal point as shares of the image's width and height. */
  readonly unit: 'pixels' | 'normalized';
}

/** [4,4] float32: camera to clip space, depth 0..1 from near to far as WebGPU has it, x right and y up. */
export interface ProjectionInput {
  readonly role: 'projection';
  readonly order?: MatrixOrder;
  /** Axes of the camera that the matrix takes points from. */
  readonly axes?: CameraAxes;
}

/** [4,4] float32: world to clip space, the product projection · view. */
export interface ViewProjectionInput {
  readonly role: 'view_projection';
  readonly order?: MatrixOrder;
}

/** [3] float32: the eye, in world units. */
export interface CameraPositionInput {
  readonly role: 'camera_position';
}

/** [2] float32: width and height of the image in pixels. */
export interface ViewportInput {
  readonly role: 'viewport';
}

/** One float32: seconds, or a share 0..1 of the contract's `duration`, which must then be declared. */
export interface TimeInput {
  readonly role: 'time';
  readonly unit: 'seconds' | 'normalized';
}

/** One int32 or int64: index of a frame, 0 or more. By `fps` the one that the time falls into, the last one at the end of `duration`; without `fps` 0. */
export interface FrameInput {
  readonly role: 'frame';
}

/** One int32 or int64: seed of a generator that draws random numbers. Without it outputs must repeat. */
export interface SeedInput {
  readonly role: 'seed';
}

/**
 * [J,3] axis-angle in radians, [J,4] quaternions, [J,3,3] row-major rotation matrices, any of them flat ([3J], [4J], [9J]), or [P] parameters of the
 * model's own; float32.
 */
export interface PoseInput {
  readonly role: 'pose';
  readonly format: 'axis-angle' | 'quaternion' | 'matrix' | 'parameters';
  /** Required for quaternions. */
  readonly quaternionOrder?: QuaternionOrder;
  /** Names of the J joints, in the tensor's order. */
  readonly joints?: readonly string[];
  /** For each joint the index of its parent, -1 for roots; a parent stands before its children. */
  readonly parents?: readonly number[];
  /** Flattened; default: no rotation, or zeros. */
  readonly default?: readonly number[];
}

/** [B] float32: coefficients of a body or an expression. */
export interface ShapeInput {
  readonly role: 'shape';
  /** Names of the B coefficients. */
  readonly names?: readonly string[];
  /** Default: zeros. */
  readonly default?: readonly number[];
}

/** Float32, int32 or int64 of any fixed shape: a control for visitors, named as the input is. */
export interface ControlInput {
  readonly role: 'control';
  /** Smallest and largest value of each element. */
  readonly range: readonly [min: number, max: number];
  /** One number for all elements, or all of them flattened. */
  readonly default: number | readonly number[];
  /** Step between values. */
  readonly step?: number;
  /** Name for readers; default: that of the input. */
  readonly label?: string;
}

/**
 * What the model itself wrote in the run before this one: float32, float16 or int32 of any fixed shape, that of an output. Physics and temporal filters are
 * such models. A run happens whenever another input changes; when the time goes back, the state begins anew.
 */
export interface StateInput {
  readonly role: 'state';
  /** Name of the output that the next run takes here. */
  readonly output: string;
  /** Before the first run: one number for all elements. Default 0. */
  readonly default?: number;
}

/** Gaussians of the generator before this one in a chain, in one of the output layouts: one input for each tensor. */
export interface GaussiansInput extends Activations {
  readonly role: 'gaussians';
  /** Which tensor of the layout this input takes. */
  readonly attribute: GaussianTensor;
}

/**
 * [1,3,H,W] float32 or float16: red, green and blue planes in 0..1, top row first. [1,4,H,W] has alpha, too; [V,3,H,W] are V images of one size, in the
 * order in which the page names them.
 */
export interface ImageInput {
  readonly role: 'image';
}

/** Role of one input of the ONNX file. */
export type InputBinding =
  | ViewInput
  | CameraToWorldInput
  | IntrinsicsInput
  | ProjectionInput
  | ViewProjectionInput
  | CameraPositionInput
  | ViewportInput
  | TimeInput
  | FrameInput
  | SeedInput
  | PoseInput
  | ShapeInput
  | ControlInput
  | StateInput
  | GaussiansInput
  | ImageInput;

/** What one Gaussian is made of. */
export type GaussianAttribute = 'positions' | 'covariances' | 'scales' | 'rotations' | 'colors' | 'sh' | 'opacities';

/** A tensor of Gaussians: everything in one, one attribute, or the live count. */
export type GaussianTensor = 'packed' | GaussianAttribute | 'count';

/** How numbers are written. Declared, never guessed: each is required where the attribute is there. */
export interface Activations {
  /** What the colour columns of a packed tensor hold. */
  readonly color?: 'rgb' | 'sh';
  /** Whether opacities are written as 0..1 or before the sigmoid. */
  readonly opacityActivation?: 'linear' | 'logit';
  /** Whether scales are written as standard deviations or as their natural logarithms. */
  readonly scaleActivation?: 'linear' | 'log';
  readonly rotationOrder?: QuaternionOrder;
  readonly shOrder?: ShOrder;
}

/**
 * One tensor [N, D], float32 or float16: position (3), covariance xx, xy, xz, yy, yz, zz (6), colour (3) or spherical
 * harmonics (3(d+1)²), opacity (1); or in the order that `columns` gives.
 */
export interface PackedOutputs {
  readonly layout: 'packed';
  /** Name of the output. */
  readonly gaussians: string;
  readonly color: 'rgb' | 'sh';
  readonly opacityActivation: 'linear' | 'logit';
  /** Required with `sh`. */
  readonly shOrder?: ShOrder;
  /**
   * What a row holds, in order: positions (3), covariances (6) or scales (3) and rotations (4), colors (3) or sh, opacities (1). Default: positions, covariances,
   * colours, opacities.
   */
  readonly columns?: readonly GaussianAttribute[];
  /** Required where `columns` has scales. */
  readonly scaleActivation?: 'linear' | 'log';
  /** Required where `columns` has rotations. */
  readonly rotationOrder?: QuaternionOrder;
  /** Name of an output [1] int32 or int64: how many of the N rows live. */
  readonly count?: string;
}

/** One tensor for each attribute, all float32 or all float16, all with the same N. Values are names of outputs. */
export interface SplitOutputs {
  readonly layout: 'split';
  /** [N,3] centres in world units. */
  readonly positions: string;
  /** [N,6] xx, xy, xz, yy, yz, zz in square world units, or [N,3,3]. Either these, or scales and rotations. */
  readonly covariances?: string;
  /** [N,3] standard deviations in world units, along the axes that the rotation turns; [N,1] or [N] for all three. */
  readonly scales?: string;
  readonly scaleActivation?: 'linear' | 'log';
  /** [N,4] quaternions, local axes to world; they need not be unit. */
  readonly rotations?: string;
  readonly rotationOrder?: QuaternionOrder;
  /** [N,3] red, green, blue in 0..1, or [N,4], whose fourth is not read. Either these or `sh`. */
  readonly colors?: string;
  /** [N,(d+1)²,3] or [N,3,(d+1)²], as `shOrder` says, or flat. */
  readonly sh?: string;
  readonly shOrder?: ShOrder;
  /** [N] or [N,1]. */
  readonly opacities: string;
  readonly opacityActivation: 'linear' | 'logit';
  /** Name of an output [1] int32 or int64: how many of the N rows live. */
  readonly count?: string;
}

/**
 * What Visionary's exporters write: one tensor [N,10] = position, opacity 0..1, covariance xx, xy, xz, yy, yz, zz; and
 * another with colours [N,4] (the fourth is padding) or [N,3], or coefficient-major harmonics [N,3(d+1)²].
 */
export interface VisionaryOutputs {
  readonly layout: 'visionary';
  readonly gaussians: string;
  /** Either these or `sh`. */
  readonly colors?: string;
  readonly sh?: string;
  readonly count?: string;
}

/** A post-processor: one tensor [1,3,H,W] of red, green and blue planes in 0..1; a fourth is not read. */
export interface ImageOutputs {
  readonly layout: 'image';
  readonly image: string;
}

export type OutputBinding = PackedOutputs | SplitOutputs | VisionaryOutputs | ImageOutputs;
