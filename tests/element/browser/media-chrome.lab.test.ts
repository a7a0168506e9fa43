/** The real media-chrome around the element: what drives a video drives a scene that moves, with nothing in between. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { sendMouse } from '@web/test-runner-commands';
import 'media-chrome';
import { assert, assertEqual, delay, nextEvent, until } from './support/harness.js';

GaussianSplatElement.runtimeLocation = '/node_modules/onnxruntime-web/dist/';

const player = (source: string): string => `
  <media-controller style="width: 320px; height: 240px; display: block">
    <gaussian-splat slot="media" ${source} camera-controls
      style="width: 320px; height: 240px"></gaussian-splat>
    <media-control-bar>
      <media-play-button></media-play-button>
      <media-time-range></media-time-range>
      <media-time-display showduration></media-time-display>
      <media-playback-rate-button rates="1 2"></media-playback-rate-button>
    </media-control-bar>
  </media-controller>`;

interface Player {
  readonly element: GaussianSplatElement;
  part(selector: string): HTMLElement;
  click(target: HTMLElement, shareOfWidth?: number): Promise<void>;
}

async function makePlayer(source = 'src="/tests/fixtures/generators/packed.onnx" loop'): Promise<Player> {
  document.body.style.margin = '0';
  const page = document.createElement('div');
  page.innerHTML = player(source);
  document.body.append(page);
  const part = (selector: string): HTMLElement => {
    const found = page.querySelector<HTMLElement>(selector);
    assert(found, selector);
    return found;
  };
  const element = part('gaussian-splat') as GaussianSplatElement;
  if (element.reveal !== 'manual') await element.ready;
  assert(element.loaded || element.reveal === 'manual', element.error?.message ?? 'not loaded');
  const click = async (target: HTMLElement, shareOfWidth = 0.5): Promise<void> => {
    const { x, y, width, height } = target.getBoundingClientRect();
    await sendMouse({ type: 'click', position: [Math.round(x + width * shareOfWidth), Math.round(y + height / 2)] });
  };
  return { element, part, click };
}

describe('media-chrome', () => {
  it('plays and pauses with its button, and shows what is so', async () => {
    const { element, part, click } = await makePlayer();
    const controller = part('media-controller');
    await until(() => controller.getAttribute('mediapaused') !== null, 'the paused state');
    await click(part('media-play-button'));
    await until(() => !element.paused, 'the time to run');
    await until(() => controller.getAttribute('mediapaused') === null, 'the playing state');
    const time = element.currentTime;
    await until(() => element.currentTime !== time, 'the time to continue');
    assert(element.matches(':state(playing)'), 'the custom state');
    await click(part('media-play-button'));
    await until(() => element.paused, 'the pause');
  });

  it('shows the duration and seeks with its range', async () => {
    const { element, part, click } = await makePlayer();
    const display = part('media-time-display');
    await until(() => /0:06/.test(display.shadowRoot?.textContent ?? ''), 'the duration of 2π seconds');
    const seeked = nextEvent(element, 'seeked', 30_000);
    await click(part('media-time-range'), 0.5);
    await seeked;
    assert(Math.abs(element.currentTime - Math.PI) < 0.7, `${element.currentTime} s at half the range`);
    await until(() => /0:03/.test(display.shadowRoot?.textContent ?? ''), 'the time that was sought');
  });

  it('sets the speed, and its keys work while its own space bar is not ours', async () => {
    const { element, part, click } = await makePlayer();
    await click(part('media-playback-rate-button'));
    await until(() => element.playbackRate === 2, 'twice the speed');
    element.focus();
    const view = element.shadowRoot?.querySelector('#view');
    let changes = 0;
    for (const type of ['play', 'pause']) element.addEventListener(type, () => changes++);
    view?.dispatchEvent(new KeyboardEvent('keydown', { key: ' ', code: 'Space', bubbles: true, composed: true }));
    view?.dispatchEvent(new KeyboardEvent('keyup', { key: ' ', code: 'Space', bubbles: true, composed: true }));
    await delay(300);
    assertEqual([changes, element.paused], [1, false], 'one toggle, by the controller');
    element.pause();
  });

  it('loads a scene behind its poster with its button, and starts again with another one', async () => {
    const { element, part, click } = await makePlayer('src="/net/sequence/movie.json" reveal="manual"');
    const controller = part('media-controller');
    await until(() => customElements.get('media-play-button') !== undefined, 'the button');
    await click(part('media-play-button'));
    await until(() => controller.hasAttribute('mediaended'), 'its end');
    element.src = '/net/sequence/movie.json?another';
    await nextEvent(element, 'load');
    await until(() => !controller.hasAttribute('mediaended'), 'no end any more');
    await until(() => Number(controller.getAttribute('mediacurrenttime')) === 0, 'the time to be shown as 0');
    assertEqual(controller.getAttribute('mediaduration'), '1.2', 'duration');
  });
});
