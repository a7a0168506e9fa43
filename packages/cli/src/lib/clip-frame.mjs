/** Reader of the frames of a clip, `.gsv` or `.4dgs`, as clouds. */
import { clipFrame, clipGroupAt, frameAt, LoadBudget, parseClip, readClipPart } from '@gaussian-splat/formats';

export const isClip = (name) => /\.(gsv|4dgs)$/i.test(name);
const isFourDgs = (name) => /\.4dgs$/i.test(name);

async function openFourDgs(bytes, name) {
  const { FourDgsClip } = await import('@gaussian-splat/formats/4dgs');
  return FourDgsClip.open(bytes, name);
}

/**
 * Opens a clip. `frame(seconds)` returns the number of the frame at a time. `splats(frame)` resolves to the splats of a
 * frame as the element shows them; in ascending order, frames decode each group once.
 * @throws GaussianSplatError as the readers of clips do
 */
export async function openClip(bytes, name) {
  const clip = isFourDgs(name) ? await openFourDgs(bytes, name) : undefined;
  const index = clip?.index ?? parseClip(bytes, name);
  const readParts = async (parts, frames) => {
    const contents = [];
    for (const part of parts) {
      const { start, sceneBytes, motionBytes } = part;
      const own = bytes.subarray(start, start + sceneBytes + motionBytes);
      contents.push(await readClipPart({ bytes: own, part, frames, shDegree: index.shDegree, name }));
    }
    return contents;
  };
  const still = await readParts(index.still, 1);
  const read = async (number) => {
    if (clip) return [await clip.group(number)];
    const { frames, parts } = index.groups[number];
    return [...still, ...(await readParts(parts, frames))];
  };
  let [group, contents] = [-1, []];
  return {
    bounds: index.bounds,
    frame: (seconds) => frameAt(index, seconds),
    async splats(frame) {
      const own = clipGroupAt(index, frame);
      if (own !== group) [group, contents] = [own, await read(own)];
      return clipFrame(contents, frame - index.groups[own].first, name, new LoadBudget(bytes.length));
    },
  };
}

/** Returns the splats of a clip at a time in seconds. @throws GaussianSplatError as the readers of clips do */
export async function clipMoment(bytes, name, seconds) {
  if (isFourDgs(name)) return (await openFourDgs(bytes, name)).at(seconds);
  const clip = await openClip(bytes, name);
  return clip.splats(clip.frame(seconds));
}
