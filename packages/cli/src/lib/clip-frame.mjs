/** Reader of a frame of a clip, `.gsv` or `.4dgs`, as a cloud. */
import { clipFrame, clipGroupAt, frameAt, LoadBudget, parseClip, readClipPart } from '@gaussian-splat/formats';

export const isClip = (name) => /\.(gsv|4dgs)$/i.test(name);

/** Returns the splats of a clip at a time in seconds. @throws GaussianSplatError as the readers of clips do */
export async function clipMoment(bytes, name, seconds) {
  if (/\.4dgs$/i.test(name)) {
    const { FourDgsClip } = await import('@gaussian-splat/formats/4dgs');
    return (await FourDgsClip.open(bytes, name)).at(seconds);
  }
  const index = parseClip(bytes, name);
  const frame = frameAt(index, seconds);
  const { shDegree, groups } = index;
  const { first, frames, parts } = groups[clipGroupAt(index, frame)];
  const contents = [];
  for (const part of parts) {
    const { start, sceneBytes, motionBytes } = part;
    const own = bytes.subarray(start, start + sceneBytes + motionBytes);
    contents.push(await readClipPart({ bytes: own, part, frames, shDegree, name }));
  }
  return clipFrame(contents, frame - first, name, new LoadBudget(bytes.length));
}
