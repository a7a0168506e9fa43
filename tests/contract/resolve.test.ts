import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import {
  carriesContract,
  checkContract,
  contractReport,
  CONTRACT_METADATA_KEY,
  gaussianLayout,
  resolveContract,
  sidecarName,
  type AttributeSlice,
  type Contract,
} from '@gaussian-splat/core/contract';
import type { OnnxTensor } from '@gaussian-splat/core/onnx';
import { fixtureHeader, fixtureSidecar } from '../support/generators.js';
import { faultsOf, headerWith, PACKED, SPLIT, SPLIT_OUTPUTS, tensor } from './support.js';

const named = (name: string): string => JSON.stringify({ ...PACKED, name });
const header = headerWith([tensor('time', [1])], [tensor('gaussians', [5, 13])], {
  metadata: new Map([[CONTRACT_METADATA_KEY, named('metadata')]]),
});

test('sources in their order: explicit, metadata, sidecar, inference', () => {
  const of = (sources: { explicit?: unknown; sidecar?: unknown }, from = header): string => {
    const { contract, source } = resolveContract({ header: from, ...sources });
    return `${source} ${contract.name}`;
  };
  const sidecar = named('sidecar');
  assert.equal(of({ explicit: { ...PACKED, name: 'object' }, sidecar }), 'explicit object');
  assert.equal(of({ explicit: named('text') }), 'explicit text');
  assert.equal(of({ sidecar }), 'metadata metadata');
  assert.equal(of({}), 'metadata metadata');
  const silent = { ...header, metadata: new Map<string, string>() };
  assert.equal(of({ sidecar }, silent), 'sidecar sidecar');
  assert.deepEqual([carriesContract(header), carriesContract(silent)], [true, false]);
  assert.equal(of({}, { ...header, metadata: new Map() }), 'inferred undefined');
});

test('a broken contract is never passed over, and the fault says where it lies', () => {
  const place = (sources: object): string => faultsOf(() => resolveContract({ header, ...sources }))[0].where;
  assert.equal(place({ explicit: '{', sidecar: named('x') }), 'contract');
  assert.equal(place({ sidecar: '{', header: { ...header, metadata: new Map() } }), 'model.contract.json');
  const metadata = new Map([[CONTRACT_METADATA_KEY, '{']]);
  assert.equal(place({ header: { ...header, metadata } }), `metadata ${CONTRACT_METADATA_KEY}`);
});

test('sidecars of paths and addresses', () => {
  assert.equal(sidecarName('a/b.onnx'), 'a/b.contract.json');
  assert.equal(sidecarName('https://x.org/b.ONNX?v=2#c'), 'https://x.org/b.contract.json?v=2#c');
  assert.equal(sidecarName('model'), 'model.contract.json');
});

test('inference from canonical names says what was taken for granted', async () => {
  const { contract, source, notes } = resolveContract({ header: await fixtureHeader('canonical.onnx') });
  assert.equal(source, 'inferred');
  assert.deepEqual(contract.outputs, {
    layout: 'split',
    positions: 'positions',
    covariances: 'covariances',
    colors: 'colors',
    opacities: 'opacities',
    opacityActivation: 'linear',
  });
  assert.deepEqual(notes[0], 'input time is time (unit seconds)');
  assert.match(notes[1], /split .*opacityActivation linear/);
});

/** Held by the Python exporter, too: packages/exporter/tests/test_written.py. */
interface Inference {
  readonly what: string;
  readonly inputs: readonly (readonly [string, OnnxTensor['dims'] | null])[];
  readonly outputs: Inference['inputs'];
  readonly contract?: Contract;
  /** Names of the unknown inputs, and `outputs` if they are unknown. */
  readonly faults?: readonly string[];
}

const inferences = JSON.parse(
  readFileSync(new URL('../fixtures/inference.json', import.meta.url), 'utf8'),
) as readonly Inference[];

for (const { what, inputs, outputs, contract, faults } of inferences) {
  test(`inferred from names and shapes: ${what}`, () => {
    const [given, written] = [inputs, outputs].map((side) =>
      side.map(([name, dims]) => tensor(name, dims ?? undefined)),
    );
    const infer = (): Contract => resolveContract({ header: headerWith(given, written) }).contract;
    if (contract) assert.deepEqual(infer(), contract);
    else {
      const found = faultsOf(infer);
      assert.deepEqual(found.map(({ tensor: name, where }) => name ?? where).sort(), faults?.toSorted());
      assert.ok(found.every(({ code }) => code === 'contract/inference'));
    }
  });
}

test("Visionary's profile", async () => {
  const rgb = await fixtureHeader('visionary-rgb.onnx');
  const { contract, notes } = resolveContract({ header: rgb });
  assert.match(notes.join(), /Visionary/);
  assert.deepEqual(checkContract(rgb, contract), []);
  const sh = await fixtureHeader('visionary-sh.onnx');
  const layout = gaussianLayout(sh, resolveContract({ header: sh }).contract)!;
  assert.deepEqual([layout.shDegree, layout.dtype, layout.capacity, layout.count], [3, 'float16', 64, 'num_points']);
});

const place = ({ attribute, tensor: name, offset, components, rowStride }: AttributeSlice): string =>
  `${attribute} ${name} ${offset}+${components}/${rowStride}`;

test('every layout comes down to slices of tensors', async () => {
  const of = async (name: string): Promise<string[]> => {
    const file = await fixtureHeader(name);
    const { contract } = resolveContract({ header: file, sidecar: fixtureSidecar(name) });
    return gaussianLayout(file, contract)!.attributes.map(place);
  };
  assert.deepEqual(await of('packed.onnx'), [
    'positions gaussians 0+3/13',
    'covariances gaussians 3+6/13',
    'colors gaussians 9+3/13',
    'opacities gaussians 12+1/13',
  ]);
  assert.deepEqual((await of('packed-sh-half.onnx')).slice(2), ['sh gaussians 9+12/22', 'opacities gaussians 21+1/22']);
  assert.deepEqual(await of('visionary-rgb.onnx'), [
    'positions gaussian_f16 0+3/10',
    'opacities gaussian_f16 3+1/10',
    'covariances gaussian_f16 4+6/10',
    'colors color_rgb 0+3/4',
  ]);
  const split = gaussianLayout(headerWith([], SPLIT_OUTPUTS), SPLIT)!;
  assert.deepEqual(
    split.attributes.map(
      (slice) => `${place(slice)} ${slice.activation} ${slice.quaternionOrder ?? slice.shOrder ?? ''}`,
    ),
    [
      'positions p 0+3/3 linear ',
      'scales s 0+3/3 log ',
      'rotations r 0+4/4 linear wxyz',
      'sh h 0+27/27 linear coefficient-major',
      'opacities o 0+1/1 logit ',
    ],
  );
  assert.deepEqual([split.shDegree, split.capacity, split.isDynamic], [2, 10, false]);
  const half = await fixtureHeader('packed-sh-half.onnx');
  const { contract } = resolveContract({ header: half, sidecar: fixtureSidecar('packed-sh-half.onnx') });
  const dynamic = gaussianLayout(half, contract)!;
  assert.deepEqual([dynamic.capacity, dynamic.isDynamic, dynamic.shDegree], [100, true, 1]);
  const post = await fixtureHeader('post.onnx');
  const filter = resolveContract({ header: post, sidecar: fixtureSidecar('post.onnx') });
  assert.equal(gaussianLayout(post, filter.contract), undefined);
});

test('a file that breaks the contract has no layout', () => {
  faultsOf(() => gaussianLayout(headerWith([], []), PACKED));
});

test('the report names every tensor with its role', async () => {
  const file = await fixtureHeader('split.onnx');
  const sections = contractReport(file, resolveContract({ header: file, sidecar: fixtureSidecar('split.onnx') }));
  const rows = new Map(sections.flatMap(({ rows: all }) => all.map(([first, ...rest]) => [first, rest.join(' | ')])));
  assert.match(rows.get('view')!, /float32 \[4, 4\] \| view, order row-major, axes RUB/);
  assert.match(rows.get('sh')!, /float32 \[64, 3, 1\] \| sh/);
  assert.match(rows.get('source')!, /beside the model/);
});
