/** Actions of a page around a scene: show it later, open panels from its labels, turn it with CSS. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { resetMouse, sendKeys, sendMouse } from '@web/test-runner-commands';
import { itInLab } from '../../support/extent-in-pages.js';
import { assert, assertEqual, COMPASS, delay, frames, show, showLoaded, until } from './support/harness.js';
import { comesToShow, isGreen, isRed, screenOf, sendTouch, turnWheel } from './support/screen.js';

/** WebGL starts sooner on SwiftShader; input and labels are the same. */
const STILL = {
  renderer: 'webgl',
  'interpolation-decay': '0',
  'interaction-prompt': 'none',
  'camera-orbit': '0deg 90deg 8m',
};

describe('a scene that is loaded without a size and shown later', () => {
  const PLACES: Readonly<Record<string, (element: GaussianSplatElement) => () => void>> = {
    'display: none': (element) => {
      element.style.display = 'none';
      return () => (element.style.display = '');
    },
    'a box without extent': (element) => {
      const box = around(element, 'div');
      box.style.cssText = 'width: 0; height: 0; overflow: hidden';
      element.style.cssText = 'width: 100%; height: 100%';
      return () => (box.style.width = box.style.height = '100px');
    },
    'a popover': (element) => {
      const popover = around(element, 'div');
      popover.popover = 'auto';
      return () => popover.showPopover();
    },
    'a dialog': (element) => {
      const dialog = around(element, 'dialog');
      return () => dialog.showModal();
    },
  };

  function around<K extends keyof HTMLElementTagNameMap>(element: Element, name: K): HTMLElementTagNameMap[K] {
    const parent = document.createElement(name);
    parent.append(element);
    document.body.append(parent);
    return parent;
  }

  for (const [renderer, test] of [
    ['webgl', it],
    ['webgpu', itInLab],
  ] as const)
    test(`is visible, as are its labels: ${renderer}`, async () => {
      for (const [name, hide] of Object.entries(PLACES)) {
        const element = show({ ...STILL, renderer, loading: 'eager' });
        element.innerHTML = '<button slot="hotspot-front" data-position="0 0 1"></button>';
        const reveal = hide(element);
        element.src = COMPASS;
        await element.ready;
        assert(element.loaded, `${name}: ${element.error?.message ?? 'not loaded'}`);
        reveal();
        const isThere = await comesToShow(element, (screen) => screen.middleOf(isRed) !== null);
        assert(isThere, `${name}: the frame stays blank`);
        await until(() => element.queryHotspot('hotspot-front')?.visible === true, `${name}: the label`);
        document.body.replaceChildren();
      }
    });
});

describe('panels and links in labels', () => {
  const LABELS = `<div slot="hotspot-a" data-position="0 0 0">
      <button popovertarget="panel">i</button>
      <div id="panel" popover style="width: 160px; height: 80px; overflow: auto; inset: auto; left: 220px; top: 20px; font: 16px sans-serif">
        <p style="margin: 0">Some words to select</p><p style="height: 400px">long</p>
      </div>
    </div>
    <a slot="hotspot-b" href="https://example.org/" data-position="1 1 0" style="font: 16px sans-serif">A link</a>
    <span slot="hotspot-c" data-position="-1 -1 0" style="font: 16px sans-serif">Words</span>`;

  async function withLabels(): Promise<GaussianSplatElement> {
    document.body.style.margin = '0';
    const element = await showLoaded(
      { ...STILL, 'camera-controls': '', zoom: 'always' },
      'width: 200px; height: 200px',
    );
    element.innerHTML = LABELS;
    // The middle of the scene hides it: its panel is to be used all the same.
    await until(() => element.queryHotspot('hotspot-a')?.visible === false, 'the labels');
    await until(() => Boolean(element.queryHotspot('hotspot-a')?.canvasPosition), 'their places');
    await frames(3);
    return element;
  }
  const middle = (node: Element): [number, number] => {
    const { x, y, width, height } = node.getBoundingClientRect();
    return [Math.round(x + width / 2), Math.round(y + height / 2)];
  };
  const thetaOf = (element: GaussianSplatElement): number => element.getCameraOrbit().theta;

  afterEach(() => resetMouse());

  it('a drag over the text of a panel selects it, the wheel scrolls it, and the scene stays', async () => {
    const element = await withLabels();
    const panel = document.getElementById('panel')!;
    panel.showPopover();
    const { x, y } = panel.firstElementChild!.getBoundingClientRect();
    await sendMouse({ type: 'move', position: [Math.round(x) + 1, Math.round(y) + 8] });
    await sendMouse({ type: 'down' });
    await sendMouse({ type: 'move', position: [Math.round(x) + 60, Math.round(y) + 8] });
    await sendMouse({ type: 'move', position: [Math.round(x) + 120, Math.round(y) + 8] });
    await sendMouse({ type: 'up' });
    assert(getSelection()!.toString().length > 5, `selected: "${getSelection()}"`);
    await turnWheel(Math.round(x) + 40, Math.round(y) + 20, 100);
    await until(() => panel.scrollTop > 0, 'the panel to scroll');
    const { theta, radius } = element.getCameraOrbit();
    assertEqual([theta, radius], [0, 8], 'orbit');
    getSelection()!.removeAllRanges();
  });

  it('two fingers on a panel are not the camera’s', async () => {
    const element = await withLabels();
    const panel = document.getElementById('panel')!;
    panel.showPopover();
    const [x, y] = middle(panel);
    const fingers = (apart: number): { x: number; y: number; id: number }[] => [
      { x: x - apart, y, id: 1 },
      { x: x + apart, y, id: 2 },
    ];
    await sendTouch('touchStart', fingers(20));
    await sendTouch('touchMove', fingers(40));
    await sendTouch('touchMove', fingers(60));
    await sendTouch('touchEnd', []);
    await frames(3);
    assertEqual(element.getCameraOrbit().radius, 8, 'radius');
  });

  it('a link has its menu, other labels and the scene have none', async () => {
    const element = await withLabels();
    const prevented: boolean[] = [];
    const onMenu = (event: Event): void => {
      prevented.push(event.defaultPrevented);
      event.preventDefault();
    };
    addEventListener('contextmenu', onMenu);
    for (const node of [...element.children].slice(1)) {
      await sendMouse({ type: 'click', position: middle(node), button: 'right' });
    }
    await sendMouse({ type: 'click', position: [100, 180], button: 'right' });
    removeEventListener('contextmenu', onMenu);
    assertEqual(prevented, [false, true, true], 'menus that the element keeps closed: link, words, scene');
  });

  it('a drag that begins on the words of a label is the camera’s, and selects nothing', async () => {
    const element = await withLabels();
    const [x, y] = middle(element.lastElementChild!);
    await sendMouse({ type: 'move', position: [x, y] });
    await sendMouse({ type: 'down' });
    await sendMouse({ type: 'move', position: [x + 20, y] });
    await sendMouse({ type: 'move', position: [x + 40, y] });
    await sendMouse({ type: 'up' });
    await frames(3);
    assert(Math.abs(thetaOf(element)) > 0.5, `theta ${thetaOf(element)}`);
    assertEqual(getSelection()!.toString(), '', 'selected');
  });

  it('a click in a panel counts after a drag that ended beside the element', async () => {
    await withLabels();
    await sendMouse({ type: 'move', position: [100, 180] });
    await sendMouse({ type: 'down' });
    await sendMouse({ type: 'move', position: [160, 190] });
    await sendMouse({ type: 'move', position: [260, 250] });
    await sendMouse({ type: 'up' });
    const panel = document.getElementById('panel')!;
    panel.showPopover();
    let clicks = 0;
    panel.firstElementChild!.addEventListener('click', () => clicks++);
    await sendMouse({ type: 'click', position: middle(panel.firstElementChild!) });
    assertEqual(clicks, 1, 'clicks');
  });

  it('a label is clicked by key after a drag that ends without a click, as with the right button', async () => {
    const button = (await withLabels()).querySelector('button')!;
    await sendMouse({ type: 'move', position: [100, 180] });
    await sendMouse({ type: 'down', button: 'right' });
    await sendMouse({ type: 'move', position: [130, 185] });
    await sendMouse({ type: 'move', position: [160, 190] });
    await sendMouse({ type: 'up', button: 'right' });
    button.focus();
    assert(document.activeElement === button, 'focus');
    await sendKeys({ press: 'Enter' });
    assert(document.getElementById('panel')!.matches(':popover-open'), 'its panel is open');
  });
});

describe('turned and tilted by CSS', () => {
  const TURNS: Readonly<Record<string, readonly [outer: string, inner: string]>> = {
    'rotate(90deg)': ['', 'transform: rotate(90deg)'],
    'rotate(180deg) scale(0.5)': ['', 'transform: rotate(180deg) scale(0.5)'],
    'rotateY(50deg) in perspective': ['perspective: 400px', 'transform: rotateY(50deg)'],
    'skewX(20deg), a zoom and a border': ['zoom: 1.5', 'transform: skewX(20deg); border: 10px solid'],
  };

  async function turned(name: string): Promise<GaussianSplatElement> {
    const element = await showLoaded({ ...STILL, 'camera-controls': '' }, 'width: 200px; height: 200px');
    const [outer, inner] = TURNS[name];
    const box = document.createElement('div');
    box.style.cssText = `${outer}; margin: 80px; width: 200px`;
    document.body.append(box);
    box.append(element);
    element.style.cssText += `; ${inner}`;
    await element.ready;
    await delay(100);
    await frames(3);
    return element;
  }

  for (const name of Object.keys(TURNS))
    it(`positionFromPoint() finds what is on the screen: ${name}`, async () => {
      const element = await turned(name);
      const screen = await screenOf(element);
      const { left, top } = element.getBoundingClientRect();
      const BALLS = [
        [isRed, 'x'],
        [isGreen, 'y'],
      ] as const;
      for (const [isColor, axis] of BALLS) {
        const place = screen.middleOf(isColor);
        assert(place, `no ball on the axis ${axis}`);
        const point = await element.positionFromPoint(left + place.x, top + place.y);
        assert(point && point[axis] > 0.8, `axis ${axis}: found ${String(point)}`);
      }
    });

  it('the scene follows the pointer', async () => {
    const element = await turned('rotate(90deg)');
    const { left, top, width, height } = element.getBoundingClientRect();
    const [x, y] = [Math.round(left + width / 2), Math.round(top + height / 2)];
    await sendMouse({ type: 'move', position: [x, y] });
    await sendMouse({ type: 'down' });
    await sendMouse({ type: 'move', position: [x, y + 25] });
    await sendMouse({ type: 'move', position: [x, y + 50] });
    await sendMouse({ type: 'up' });
    await frames(3);
    const { theta, phi } = element.getCameraOrbit();
    // The element's own right is the screen's below: 50 of 200 pixels are a quarter turn.
    assert(Math.abs(theta + Math.PI / 2) < 0.01 && Math.abs(phi - Math.PI / 2) < 0.01, `orbit ${theta} ${phi}`);
    await resetMouse();
  });
});
