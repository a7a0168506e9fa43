/** The checker's page as it is built, with real files dropped on it. */
import { assert, assertEqual, nextEvent, until } from '../../element/browser/support/harness.js';

const FIXTURES = '/tests/fixtures/generators/';
/** A software GPU runs a model unless it is slower than the CPU, which the page measures. */
const PLACES = /In a page it runs on (the GPU|the CPU: webgpu: this browser has no hardware GPU)/;

async function openPage(): Promise<Document> {
  const frame = document.createElement('iframe');
  frame.src = '/demo/dist/check/index.html';
  frame.style.cssText = 'width: 700px; height: 500px';
  const loaded = nextEvent(frame, 'load');
  document.body.append(frame);
  await loaded;
  return frame.contentDocument!;
}

async function fixture(name: string): Promise<File> {
  const response = await fetch(FIXTURES + name);
  assert(response.ok, `${name}: ${response.status}`);
  return new File([await response.arrayBuffer()], name);
}

/** Drops files and waits for the verdict, which must be about the first. */
async function drop(page: Document, ...files: File[]): Promise<{ verdict: string; faults: string[]; text: string }> {
  const dataTransfer = new DataTransfer();
  for (const file of files) dataTransfer.items.add(file);
  const event = new DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true });
  page.getElementById('report')!.replaceChildren();
  page.getElementById('drop')!.dispatchEvent(event);
  assert(event.defaultPrevented, 'the browser does not open the file instead of the page');
  await until(() => page.querySelector('.verdict') !== null, 'a verdict');
  return {
    verdict: page.querySelector('.verdict')!.textContent!,
    faults: [...page.querySelectorAll('.faults li')].map((item) => item.textContent!),
    text: page.getElementById('report')!.innerText,
  };
}

describe('the page of the checker', () => {
  it('shows the tables of a file that carries its contract', async () => {
    const { verdict, faults, text } = await drop(await openPage(), await fixture('packed.onnx'));
    assertEqual([verdict, faults], ['packed.onnx keeps the contract.', []]);
    for (const part of ['Breathing ball', 'float32 [64, 13]', 'time, unit seconds', "the file's own metadata"]) {
      assert(text.includes(part), `${part} in ${text}`);
    }
  });

  it('takes a contract that is dropped along, and says what is wrong with it', async () => {
    const page = await openPage();
    const [model, contract] = [await fixture('split.onnx'), await fixture('split.contract.json')];
    assertEqual((await drop(page, contract, model)).verdict, 'split.onnx keeps the contract.');
    const wrong = new File([(await contract.text()).replace('"xyzw"', '"zyxw"').replace('"log"', '"exp"')], 'c.json');
    const { verdict, faults, text } = await drop(page, model, wrong);
    assertEqual(verdict, 'split.onnx: 2 faults');
    assert(/scaleActivation: expected one of linear, log, found "exp"/.test(faults[0]), faults[0]);
    assert(/rotationOrder.*wxyz, xyzw.*"zyxw".*\[contract\/schema\]/.test(faults[1]), faults[1]);
    assert(text.includes('float32 [64, 3, 1]'), 'the tables of the file are there all the same');
  });

  it('says that a contract was inferred, and what is missing where it cannot be', async () => {
    const page = await openPage();
    const inferred = await drop(page, await fixture('canonical.onnx'));
    assert(inferred.text.includes('inferred from names'), inferred.text);
    assertEqual((await drop(page, await fixture('subgraphs.onnx'))).verdict, 'subgraphs.onnx: 6 faults');
    const external = await fixture('external.onnx');
    assertEqual((await drop(page, external)).verdict, 'external.onnx keeps the contract.');
    const short = new File(['too short'], 'external.weights');
    assert(/at least 6656 bytes, found 9/.test((await drop(page, external, short)).faults[0]), 'short weights');
    assertEqual((await drop(page, external, await fixture('external.weights'))).faults, []);
  });

  it('names files that are something else, and lives on', async () => {
    const page = await openPage();
    const html = new File(['<!doctype html><title>404</title>'], 'model.onnx');
    assert(/web page \(HTML\).*\[decode\/html\]/.test((await drop(page, html)).faults[0]), 'HTML');
    assert(/PLY file/.test((await drop(page, new File(['ply\nformat ascii 1.0\n'], 'scene.ply'))).faults[0]), 'PLY');
    assert(/ONNX file along/.test((await drop(page, new File(['{}'], 'c.json'))).faults[0]), 'a contract alone');
    assertEqual((await drop(page, await fixture('packed.onnx'))).faults, []);
  });

  it('runs a model here: what the command says of it, and how the GPU differs', async () => {
    const runs = (await (await fetch('/tests/fixtures/check-runs.json')).json()) as Record<string, string[][]>;
    const page = await openPage();
    for (const [name, expected] of Object.entries(runs)) {
      await drop(page, await fixture(name));
      page.querySelector<HTMLButtonElement>('.run button')!.click();
      await until(() => page.querySelector('.run .verdict') !== null, `${name}: the runs`, 100_000);
      const place = page.querySelector<HTMLElement>('.run')!;
      const cells = [...place.querySelectorAll('tr')].map((row) => [...row.children].map((cell) => cell.textContent!));
      assertEqual(
        cells.map((row) => row.slice(0, 3)),
        expected,
        name,
      );
      const faults = [...place.querySelectorAll('.faults li')].map((item) => item.textContent!);
      const isWrong = name === 'spelled-hidden.onnx';
      assertEqual(faults.length > 0, isWrong, faults.join());
      assert(PLACES.test(place.innerText), place.innerText);
      assert(
        cells.every((row) => /on the GPU$/.test(row[4])),
        `${name}: ${cells.map((row) => row[4]).join()}`,
      );
      if (isWrong) assert(/differ by up to .* of the largest on the GPU/.test(faults[0]), faults[0]);
    }
  }).timeout(240_000);
});
