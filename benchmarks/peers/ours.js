/** Another build of our renderer as a subject of the benchmark (see run/measure.js). It loads the scene itself, because each build has its own packed form. */
import { describeEnvironment, openDevice } from '../run/environment.js';
import { OwnRenderer } from '../run/own-renderer.js';
import { BenchScene } from '../run/scenes.js';

window.openSubject = async (configuration) => {
  const gpu = await openDevice();
  const scene = await BenchScene.load(gpu.device, configuration);
  const subject = new OwnRenderer(gpu.device, await scene.upload(configuration.pack), configuration);
  const ownFacts = subject.facts.bind(subject);
  const { versions } = describeEnvironment(gpu);
  return Object.assign(subject, { facts: async () => ({ ...(await ownFacts()), versions, errors: gpu.errors }) });
};
