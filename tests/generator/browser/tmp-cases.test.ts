import { Generator } from '@gaussian-splat/generator';
import { makeDevice, numbersOf, ReadingSink } from './support.js';
const NAMES = 'cast-f16 constant-node dequantized grouped guarded identity k1-stride2 strided strided-padded'.split(' ');
for (const name of NAMES) it(name, async () => {
  localStorage.clear();
  const device = await makeDevice();
  const want = await (await fetch(`/tests/tmp-cases/${name}.want.json`)).json() as Record<string, number[]>;
  const sink = new ReadingSink(device); const reasons: string[] = [];
  const g = await Generator.open({ url: `/tests/tmp-cases/${name}.onnx` }, device, { onError: reportError, onFallback: (r) => reasons.push(r) });
  g.sink = sink; g.request({ timeSeconds: 1 }); await g.idle; await new Promise((r) => setTimeout(r, 100)); await g.idle;
  let worst = 0;
  for (const [key, values] of Object.entries(want)) {
    const got = numbersOf(await sink.runs.at(-1)!.tensors[key], 'float32');
    values.forEach((v, i) => { worst = Math.max(worst, Math.abs(v - got[i])); });
  }
  console.log(`CASE ${name}: ${g.kind} worst ${worst.toExponential(2)} ${reasons.join()}`);
  if (worst > 1e-3) throw new Error(`${worst}`);
  g.close();
});
