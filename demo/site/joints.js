/** Names of a model's joints, in the order of its pose. */
import { resolveContract } from '@gaussian-splat/core/contract';
import { openUrl, readOnnxHeader } from '@gaussian-splat/core/onnx';

/** Reads the contract of a model from its header alone. @param url {URL} */
export async function jointsOf(url) {
  const header = await readOnnxHeader(await openUrl(url));
  return resolveContract({ header }).contract.inputs.pose.joints;
}
