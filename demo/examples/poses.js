/** Poses of the walker: axis-angle for each joint of its contract, radians, in the file's frame (x right, y down, z forward). */

/** Arms that hang: the body rests with them spread. */
const HANGING = { upperarm_l: [0, 0, 0.55], upperarm_r: [0, 0, -0.55] };

/**
 * Turns of joints by name, as one list for the element's `pose`.
 * @param {readonly string[]} joints names in the contract's order
 * @param {Record<string, readonly number[]>} turns
 */
export function flatten(joints, turns) {
  return Float32Array.from(joints.flatMap((name) => turns[name] ?? [0, 0, 0]));
}

/**
 * A pose from a few handles, each 0 to 1 (head: -1 to 1).
 * @param {readonly string[]} joints
 * @param {{ arms: number, knees: number, head: number }} handles
 */
export function poseOf(joints, { arms, knees, head }) {
  const raised = 0.55 - 1.9 * arms;
  return flatten(joints, {
    upperarm_l: [0, 0, raised],
    upperarm_r: [0, 0, -raised],
    thigh_l: [-1.1 * knees, 0, 0],
    thigh_r: [-1.1 * knees, 0, 0],
    calf_l: [1.7 * knees, 0, 0],
    calf_r: [1.7 * knees, 0, 0],
    foot_l: [-0.6 * knees, 0, 0],
    foot_r: [-0.6 * knees, 0, 0],
    head: [0, 0.7 * head, 0],
  });
}

/**
 * One moment of a walk.
 * @param {readonly string[]} joints
 * @param {number} phase 0 to 1, one step of each leg
 */
export function walkingPose(joints, phase) {
  const swing = Math.sin(2 * Math.PI * phase);
  const bend = (shift) => 0.15 + 0.75 * Math.max(0, Math.sin(2 * Math.PI * (phase + shift))) ** 2;
  return flatten(joints, {
    ...HANGING,
    upperarm_l: [0.45 * swing, 0, HANGING.upperarm_l[2]],
    upperarm_r: [-0.45 * swing, 0, HANGING.upperarm_r[2]],
    lowerarm_l: [-0.35, 0, 0],
    lowerarm_r: [-0.35, 0, 0],
    thigh_l: [-0.5 * swing - 0.1, 0, 0],
    thigh_r: [0.5 * swing - 0.1, 0, 0],
    calf_l: [bend(0.75), 0, 0],
    calf_r: [bend(0.25), 0, 0],
    spine_01: [0, 0.08 * swing, 0],
    spine_03: [0, -0.12 * swing, 0],
  });
}
