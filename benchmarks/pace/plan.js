/** Changes to the page, from its address: sizes, and consecutive steps of the load. */

/**
 * Changes of the load; each is one number.
 * @property distance distance of the camera, as a multiple of that at which the scene fills the frame
 * @property size size of the elements' sides, as a multiple of `width` and `height`
 * @property elements number of visible elements
 * @property load size of the elements: their full frames together take this multiple of the target
 * @property burn GPU time of other work of the page in each frame, as a multiple of the target
 */
export const CHANGES = ['distance', 'size', 'elements', 'load', 'burn'];

const STEPS =
  'distance:0.6,distance:3,distance:0.6,size:2,size:1,elements:4,elements:1,load:0.5,load:1,load:2,load:3,load:0.5,burn:0.5,burn:2,burn:0';

/** `distance:3,size:2` as changes. @returns {{what: string, value: number}[]} */
export function parseSteps(text) {
  return text.split(',').map((word) => {
    const [what, number] = word.split(':');
    const value = Number(number);
    const isPossible = CHANGES.includes(what) && number !== undefined && value >= 0 && (what === 'burn' || value > 0);
    if (!isPossible) throw new RangeError(`steps: expected ${CHANGES.join(', ')} with a number, found "${word}"`);
    return { what, value };
  });
}

/** All that the address may say. */
export function readPlan(query) {
  const number = (name, fallback) => {
    const value = Number(query.get(name) ?? fallback);
    if (!(value >= 0)) throw new RangeError(`${name}: expected a number, found "${query.get(name)}"`);
    return value;
  };
  return {
    scene: query.get('scene') ?? '../scenes/skull.spz',
    /** Number of splats that copies of the scene on the ground reach; 0: one copy. */
    splats: number(query.has('n') ? 'n' : 'splats', 0),
    /** Bands of color that repeated splats keep at most: millions of them make a smaller file. */
    degree: number('degree', 3),
    /** Initial values of the camera, as in the steps. */
    distance: number('distance', 1),
    /** Device pixels. */
    width: number('width', 960),
    height: number('height', 540),
    /** Longest side that a step may lead to, device pixels. */
    most: number('most', 8192),
    /** Budget of frames in motion, as a multiple of the first full frame's time; 0: that of the display. */
    budget: number('budget', 0),
    /** Milliseconds of other work for the GPU in the second half of each frame: what is idle most of the time runs at a fraction of its clock. */
    warm: number('warm', 0),
    /** Seconds of each step, before the camera rests. */
    seconds: number('seconds', 6),
    /** Seconds of motion under the initial load, before each step. */
    before: number('before', 1),
    /** Seconds after which no further step starts. */
    limit: number('limit', 600),
    /** Degrees a second. */
    speed: number('speed', 28.6),
    /** Other attributes of the elements. */
    attributes: JSON.parse(query.get('attributes') ?? '{}'),
    /** Compares the frame at rest with `toBlob()`. */
    compares: query.get('compare') !== '0',
    /** Keeps the times of all frames of the first element in the report. */
    keepsFrames: query.get('keep') === '1',
    steps: parseSteps(query.get('steps') ?? STEPS),
    report: query.get('report'),
  };
}
