/** Puts a subject (see run/measure.js) through a case and says what came out. */
import { compareImages } from '../quality/metrics.js';

const FLICKER_FRAMES = 8;

/**
 * @returns {{figure: number, unit: string, passes: boolean, image: Float32Array}} dB after rounding to 8 bits, of the worst view; or differing bytes
 */
export async function judge(subject, one, references) {
  if (one.kind === 'flicker') return judgeFlicker(subject, one);
  if (one.kind === 'turn') return judgeTurn(subject, one, references);
  let worst;
  for (const [i, view] of one.views.entries()) {
    const image = await subject.capture(view);
    const { psnrShown: figure } = compareImages(image, references[i], view);
    if (worst === undefined || !(figure >= worst.figure)) worst = { figure, image };
  }
  return { ...worst, unit: 'dB', passes: worst.figure >= one.least };
}

/** The first frame of a new direction, without waiting for a late order. */
async function judgeTurn(subject, { views: [before, after], least: min }, references) {
  await subject.capture(before);
  const image = await subject.snapshot(after);
  const { psnrShown: figure } = compareImages(image, references[1], after);
  return { figure, image, unit: 'dB', passes: figure >= min };
}

async function judgeFlicker(subject, { views: [view], most: max }) {
  const bytes = async () =>
    Uint8Array.from(await subject.snapshot(view), (x) => Math.round(255 * Math.min(1, Math.max(0, x))));
  const image = await subject.capture(view);
  const first = await bytes();
  let figure = 0;
  for (let frame = 1; frame < FLICKER_FRAMES; frame++) {
    const next = await bytes();
    figure += next.reduce((count, value, i) => count + (value === first[i] ? 0 : 1), 0);
  }
  return { figure, image, unit: 'bytes', passes: figure <= max };
}
