/** Doors between scenes: by click, by keyboard and on foot, back and forth, with rooms fetched once, flat memory and a plan. */
import { holdings } from './support/ledger.js';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { encodeFloorMap } from '@gaussian-splat/formats/floor';
import { sendKeys } from '@web/test-runner-commands';
import { itInLab } from '../../support/extent-in-pages.js';
import { headset } from './support/headset.js';
import { insideOf } from './support/inside.js';
import { assert, assertEqual, atRest, claimFault, delay, frames, nextEvent, show, until } from './support/harness.js';

/** Rooms of 4 by 4 m in a row: each door leads to the next one or back. One arrives at z = 0.9. */
const NAMES = ['a', 'b', 'c'] as const;
/** On the server: another one for each tour, so that no cache has its files. */
let folder = '';
const addressOf = (name: string): string => new URL(`${folder}/${name}`, location.href).href;

const put = (name: string, body: BodyInit): Promise<Response> => fetch(`${folder}/${name}`, { method: 'PUT', body });
let tours = 0;

/** Puts the rooms on the server: two walls, behind each door, in a color of the room, and the map of its floor. */
function putRooms(): Promise<unknown> {
  folder = `/net/kept/doors-${Math.round(performance.timeOrigin)}-${++tours}`;
  const width = 40;
  const layers = [new Float32Array(width * width)];
  const map = encodeFloorMap({ cell: 0.1, corner: [-2, -2], width, depth: width, layers, step: 0.3, start: [0, 0, 0], area: 16 }); // prettier-ignore
  return Promise.all(
    NAMES.flatMap((name, room) => {
      const view = new DataView(new ArrayBuffer(32 * 800));
      for (let i = 0; i < 800; i++) {
        const at = [((i % 20) - 9.5) * 0.25, -(Math.floor((i % 400) / 20) + 0.5) * 0.15, i < 400 ? 2.5 : -2.5];
        [...at, 0.1, 0.1, 0.01].forEach((value, k) => view.setFloat32(32 * i + 4 * k, value, true));
        const color = [0, 0, 0].map((_, k) => (k === room ? 220 : 30));
        [...color, 255, 255, 128, 128, 128].forEach((value, k) => view.setUint8(32 * i + 24 + k, value));
      }
      return [put(`${name}.splat`, view.buffer), put(`${name}.floor`, new Uint8Array(map))];
    }),
  );
}

function doorOf(from: string, to: string, z: number, heading: string): HTMLElement {
  const door = document.createElement('button');
  door.textContent = `To ${to}`;
  door.slot = `hotspot-${from}-${to}`;
  const data = { door: `${folder}/${to}.splat`, room: `${folder}/${from}.splat`, floorMap: `${folder}/${to}.floor` };
  Object.assign(door.dataset, { ...data, position: `0 1.6m ${z}m`, heading });
  return door;
}

/** @param sceneAfter Milliseconds until the element gets its scene. @param onShown Called before the element has doors. @param names Rooms with doors. */
async function showTour(
  attributes: Readonly<Record<string, string>> = {},
  sceneAfter = 0,
  onShown: (element: GaussianSplatElement) => void = () => undefined,
  names: readonly string[] = NAMES,
): Promise<GaussianSplatElement> {
  await putRooms();
  const scene = `${folder}/a.splat`;
  const element = show(
    {
      ...{
        ...(sceneAfter === 0 && { src: scene }),
        'walk-map': `${folder}/a.floor`,
        unit: '1m',
        'camera-controls': '',
      },
      ...{ 'camera-orbit': '0deg 90deg 1m', 'camera-target': '0m 1.6m 0m', 'interaction-prompt': 'none' },
      ...{ 'interpolation-decay': '0', ...attributes },
    },
    'width: 200px; height: 160px',
  );
  onShown(element);
  for (const [i, name] of names.entries()) {
    if (i + 1 < names.length) element.append(doorOf(name, names[i + 1], -1.9, '0deg'));
    if (i > 0) element.append(doorOf(name, names[i - 1], 1.9, '180deg'));
  }
  if (sceneAfter > 0) {
    await delay(sceneAfter);
    element.src = scene;
    await element.updateComplete;
  }
  await element.ready;
  return element;
}

const shownDoors = (element: GaussianSplatElement): string[] =>
  [...element.querySelectorAll<HTMLElement>('[data-door]')]
    .filter((door) => door.checkVisibility())
    .map(({ textContent }) => textContent);

const doorTo = (element: GaussianSplatElement, name: string): HTMLElement =>
  [...element.querySelectorAll<HTMLElement>('[data-door]')].find(
    (door) => !door.hidden && door.textContent === `To ${name}`,
  )!;

/** Names of the files that the server was asked for. */
const log = async (): Promise<string[]> => (await (await fetch(`${folder}/log`)).json()) as string[];

const scenesAsked = async (): Promise<string[]> => (await log()).filter((name) => name.endsWith('.splat'));

async function pass(element: GaussianSplatElement, name: string): Promise<void> {
  const changed = nextEvent<CustomEvent<{ url: string }>>(element, 'room-change', 60_000);
  doorTo(element, name).click();
  assertEqual((await changed).detail.url, addressOf(`${name}.splat`), 'room');
}

/** Goes through a door by keys alone: turns until its label is in view, and chooses it. */
async function passByKeys(element: GaussianSplatElement, name: string): Promise<void> {
  const changed = nextEvent<CustomEvent<{ url: string }>>(element, 'room-change', 60_000);
  const door = doorTo(element, name);
  const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
  for (let presses = 0; !door.checkVisibility({ visibilityProperty: true }); presses++) {
    assert(presses < 60, `the door to ${name} never comes into view`);
    view.focus();
    await sendKeys({ press: 'ArrowLeft' });
    await frames();
  }
  door.focus();
  await sendKeys({ press: 'Enter' });
  assertEqual((await changed).detail.url, addressOf(`${name}.splat`), 'room');
}

async function enterVr(element: GaussianSplatElement): Promise<void> {
  const { device } = headset();
  device.position.set(0, 1.6, 0);
  device.quaternion.set(0, 0, 0, 1);
  const button = (): HTMLElement | null => element.shadowRoot!.querySelector('[part=vr-button]');
  await until(() => button() !== null, 'the button');
  button()!.click();
  await until(() => element.getAttribute('vr-status') === 'session-started', 'the session');
  await until(() => isIn(0), 'the first room in the headset');
}

async function leaveVr(element: GaussianSplatElement): Promise<void> {
  element.exitXR!();
  await until(() => element.getAttribute('vr-status') === 'not-presenting', 'the end');
  headset().layer = undefined;
}

/** Whether the headset shows a room: each has a color of its own. */
function isIn(room: number): boolean {
  if (!headset().layer) return false;
  const pixels = headset().pixels('left');
  const brightest = (channel: number): number =>
    pixels.reduce((max, value, i) => (i % 4 === channel ? Math.max(max, value) : max), 0);
  return [0, 1, 2].every((channel) => brightest(channel) > 150 === (channel === room));
}

describe('doors', () => {
  // Many pages set the display of their buttons, which would show hidden ones.
  const page = new CSSStyleSheet();
  page.replaceSync('button { display: inline-block }');
  before(() => void document.adoptedStyleSheets.push(page));
  after(() => void document.adoptedStyleSheets.splice(document.adoptedStyleSheets.indexOf(page), 1));

  it('a click shows the scene behind the door, seen from its door, and the doors of that room', async () => {
    const element = await showTour();
    await until(() => shownDoors(element).length === 1, 'the doors of the first room');
    assertEqual(shownDoors(element), ['To b'], 'doors');
    await pass(element, 'b');
    assertEqual(shownDoors(element), ['To c', 'To a'], 'doors');
    const { x, y, z } = element.getCameraTarget();
    const found = [x, y, z, element.getCameraOrbit().theta % (2 * Math.PI)].map((value) => value.toFixed(3));
    assertEqual(found, ['0.000', '1.600', '-0.100', '0.000'], 'the view from the door');
    // Back, one comes in at the other end and looks the other way.
    await pass(element, 'a');
    assertEqual(element.getCameraTarget().z.toFixed(3), '0.100', 'the view from the door back');
    // The door of the second room that leads back says where to look: to -x.
    element.querySelector<HTMLElement>('[slot="hotspot-b-a"]')!.dataset.arrivalHeading = '90deg';
    await frames();
    await pass(element, 'b');
    const turned = [element.getCameraTarget().x, element.getCameraOrbit().theta].map((value) => value.toFixed(3));
    assertEqual(turned, ['-1.000', (Math.PI / 2).toFixed(3)], 'the view that the door names');
  });

  /** A door to room b whose file waits for a gate. */
  const gatedDoor = (gate: string): HTMLElement => {
    const door = doorOf('a', 'b', -1.9, '0deg');
    door.dataset.door += `?gate=${gate}&passing=0`;
    return door;
  };

  it('a visitor who is faster than the file behind a door waits for the rest of it, which is not requested again', async () => {
    const element = await showTour({}, 0, undefined, []);
    await until(() => element.loaded, 'the first room');
    const gate = folder.replaceAll('/', '-');
    const door = gatedDoor(gate);
    element.append(door);
    await until(async () => (await log()).includes('b.splat'), 'a request ahead');
    const bar = (): Element | null => element.shadowRoot!.querySelector('[role=progressbar]');
    assertEqual(bar(), null, 'progress before');
    const changed = nextEvent(element, 'room-change', 60_000);
    door.click();
    await until(() => bar() !== null, 'progress');
    await frames(3);
    assertEqual(element.loaded, true, 'the room stays until the next is there');
    await fetch(`/net/open/${gate}`);
    await changed;
    assertEqual(await scenesAsked(), ['a.splat', 'b.splat'], 'requests');
    await until(() => bar() === null, 'the end of progress');
  });

  it('the latest choice counts: another door, or a scene that the page sets meanwhile', async () => {
    const element = await showTour({}, 0, undefined, []);
    await until(() => element.loaded, 'the first room');
    const gate = folder.replaceAll('/', '-');
    const rooms: string[] = [];
    element.addEventListener('room-change', ({ detail }) => rooms.push(detail.url));
    const [slow, other] = [gatedDoor(gate), doorOf('a', 'c', 1.9, '180deg')];
    element.append(slow, other, doorOf('c', 'a', 1.9, '0deg'));
    await until(async () => (await log()).includes('b.splat'), 'a request ahead');
    slow.click();
    other.click();
    await until(() => rooms.length > 0, 'a room');
    assertEqual(rooms, [addressOf('c.splat')], 'rooms');
    doorTo(element, 'a').click();
    element.src = `${folder}/b.splat`;
    await until(() => insideOf(element).sources.ownEntry.scene.shownRequest?.url === addressOf('b.splat'), 'b');
    await frames(3);
    assertEqual(rooms, [addressOf('c.splat')], 'rooms after the page has set another scene');
    assertEqual(shownDoors(element), [], 'doors');
    await fetch(`/net/open/${gate}`);
  });

  it('a room that failed can be entered again; doors without a room are those of the scene that the page sets', async () => {
    const element = await showTour({}, 0, undefined, []);
    await until(() => element.loaded, 'the first room');
    const [absent, present] = [doorOf('a', 'absent', -1.9, '0deg'), doorOf('a', 'c', 1.9, '180deg')];
    element.append(absent, present);
    await until(async () => (await scenesAsked()).includes('c.splat'), 'the file behind the second door');
    claimFault(/absent.splat.*404/);
    const failed = nextEvent(element, 'error', 60_000);
    absent.click();
    await failed;
    await until(() => element.loaded && !absent.hidden, 'the room before, with its doors');
    assertEqual(insideOf(element).sources.ownEntry.scene.shownRequest?.url, addressOf('a.splat'), 'scene');
    const spoken = element.shadowRoot!.querySelector('[role=status]')!;
    await until(() => /could not be downloaded/.test(spoken.textContent), 'the failure is read');
    await put('absent.splat', await (await fetch(`${folder}/b.splat`)).blob());
    const changed = nextEvent<CustomEvent<{ url: string }>>(element, 'room-change', 60_000);
    absent.click();
    assertEqual((await changed).detail.url, addressOf('absent.splat'), 'room');
    // Back by the page: its own pose and map, not those of the visitor's way.
    element.src = `${folder}/a.splat`;
    await until(() => !absent.hidden && element.loaded, 'the first room again');
    assertEqual(
      [element.getAttribute('camera-target'), new URL(element.walkMap!, location.href).href],
      ['0m 1.6m 0m', addressOf('a.floor')],
      'target and map',
    );

    const own = doorOf('b', 'a', -1.9, '0deg');
    delete own.dataset.room;
    element.replaceChildren(own);
    element.src = `${folder}/b.splat`;
    await until(() => !own.hidden && element.loaded, 'the door of another tour');
    await pass(element, 'a');
  });

  it('addresses that the page rewrites: the file ahead and the room have them, doors have their own', async () => {
    const { urlModifier } = GaussianSplatElement;
    GaussianSplatElement.urlModifier = (url) => `${url}?signed`;
    try {
      const element = await showTour();
      await until(() => shownDoors(element).length === 1, 'the doors of the first room');
      await pass(element, 'b');
      assertEqual(shownDoors(element), ['To c', 'To a'], 'doors');
    } finally {
      GaussianSplatElement.urlModifier = urlModifier;
    }
  });

  it('doors of other rooms are not seen while the code for doors is on its way', async () => {
    let arrive!: () => void;
    const arrived = new Promise<void>((resolve) => (arrive = resolve));
    // `ready` waits for all code.
    const element = await new Promise<GaussianSplatElement>((resolve) => {
      void showTour({}, 0, (shown) => {
        const { announcer } = insideOf(shown);
        const get = announcer.get.bind(announcer);
        // The code for doors waits for it.
        announcer.get = () => arrived.then(get);
        resolve(shown);
      });
    });
    await nextEvent(element, 'load');
    const seen = (): string[] =>
      [...element.querySelectorAll<HTMLElement>('[data-door]')]
        .filter((door) => door.checkVisibility({ visibilityProperty: true }))
        .map(({ slot }) => slot);
    await until(() => element.shadowRoot!.querySelectorAll('.hotspot').length === 4, 'the boxes of all labels');
    await atRest(element);
    await frames(3);
    assertEqual(seen(), [], 'doors before');
    arrive();
    await until(() => seen().length > 0, 'a door');
    assertEqual(seen(), ['hotspot-a-b'], 'doors');
  });

  it('the keyboard goes through doors, and the room is announced', async () => {
    const element = await showTour();
    await until(() => shownDoors(element).length === 1, 'the doors of the first room');
    doorTo(element, 'b').focus();
    const changed = nextEvent(element, 'room-change', 60_000);
    await sendKeys({ press: 'Enter' });
    await changed;
    await until(() => /To b/.test(element.shadowRoot!.querySelector('[role=status]')!.textContent), 'the room is read');
    assertEqual(element.shadowRoot!.activeElement?.id, 'view', 'the focus after the door');
  });

  it('a visitor walks through doors, from room to room', async () => {
    const element = await showTour({ navigation: 'walk' });
    if (!element.getAttribute('walk-ready')) await until(() => element.getCameraTarget().y > 1.5, 'the floor');
    const view = element.shadowRoot!.querySelector<HTMLElement>('#view')!;
    const press = (type: string): boolean =>
      view.dispatchEvent(new KeyboardEvent(type, { code: 'KeyW', key: 'w', bubbles: true, cancelable: true }));
    for (const name of ['b', 'c']) {
      const changed = nextEvent<CustomEvent<{ url: string }>>(element, 'room-change', 60_000);
      // A key counts only when the floor is known, so that it is pressed until it does.
      const pressing = setInterval(() => press('keydown'), 200);
      assertEqual((await changed).detail.url, addressOf(`${name}.splat`), 'room');
      clearInterval(pressing);
      press('keyup');
    }
  });

  it('a walk that begins beside a door stays in its room until the visitor walks', async () => {
    // The camera is first far from the floor.
    const element = await showTour({ navigation: 'walk', 'camera-orbit': '0deg 20deg 6m' }, 0, undefined, []);
    const rooms: string[] = [];
    element.addEventListener('room-change', ({ detail }) => rooms.push(detail.url));
    await until(() => element.loaded, 'the first room');
    element.append(doorOf('a', 'b', 0, '0deg'));
    await until(() => shownDoors(element).length === 1, 'the door');
    await until(() => element.getCameraTarget().y > 1.5 && element.getCameraOrbit().phi > 1.5, 'the floor');
    await atRest(element);
    await frames(5);
    assertEqual(rooms, [], 'rooms');
  });

  itInLab('the plan shows all rooms, and a click on one goes there', async () => {
    // The code of the plan is here before the scene.
    const element = await showTour({ 'floor-plan': '' }, 1_500);
    const plan = (): HTMLCanvasElement | null => element.shadowRoot!.querySelector('[part=floor-plan]');
    await until(() => (plan()?.height ?? 0) > 2.5 * (plan()?.width ?? 1), 'three rooms in a row');
    const changed = nextEvent<CustomEvent<{ url: string }>>(element, 'room-change', 60_000);
    const { left, top, width, height } = plan()!.getBoundingClientRect();
    assert(height < 0.5 * element.clientHeight && width < 0.5 * element.clientWidth, `a plan of ${width} x ${height}`);
    // The first room is nearest to the viewer: the last is on top.
    const at = { clientX: left + width / 2, clientY: top + height / 8, bubbles: true };
    plan()!.dispatchEvent(new MouseEvent('click', at));
    assertEqual((await changed).detail.url, addressOf('c.splat'), 'room');
    const colors = plan()!.getContext('2d')!.getImageData(0, 0, plan()!.width, plan()!.height).data;
    const count = (r: number, g: number): number =>
      colors.reduce((sum, _, i) => sum + Number(i % 4 === 0 && colors[i] === r && colors[i + 1] === g), 0);
    assert(count(0xe9, 0xe4) > 1000 && count(0x8f, 0x8a) > 2000, 'one room is present, two are not');
    assert(count(0xff, 0x5a) > 20, 'the visitor');
  });

  itInLab('a session in a headset continues behind the door, by click and on foot', async () => {
    const { device } = headset();
    const element = await showTour({ navigation: 'walk', vr: '' });
    await enterVr(element);
    await pass(element, 'b');
    await until(() => isIn(1), 'the second room in the headset');
    assertEqual(element.getAttribute('vr-status'), 'session-started', 'status');
    // One arrives at z = 0.9 m: two steps of the body lead to the next door.
    const changed = nextEvent<CustomEvent<{ url: string }>>(element, 'room-change', 60_000);
    for (const z of [-0.8, -1.6, -2.3]) {
      device.position.set(0, 1.6, z);
      await delay(400);
    }
    assertEqual((await changed).detail.url, addressOf('c.splat'), 'room');
    await until(() => isIn(2), 'the third room in the headset');
    assertEqual(element.getAttribute('vr-status'), 'session-started', 'status');
    await leaveVr(element);
  });

  for (const place of ['page', 'headset'] as const)
    itInLab(`60 crossings in a ${place}: rooms are fetched once ahead, and memory stays flat`, async () => {
      if (place === 'headset') headset();
      const element = await showTour(place === 'headset' ? { vr: '' } : {});
      await until(() => shownDoors(element).length === 1, 'the doors of the first room');
      if (place === 'headset') await enterVr(element);
      let longTasks = 0;
      const observer = new PerformanceObserver((list) => (longTasks += list.getEntries().length));
      observer.observe({ type: 'longtask' });
      const bytes: number[] = [];
      for (let i = 0; i < 60; i++) {
        const name = ['b', 'c', 'b', 'a'][i % 4];
        if (place === 'headset') {
          await pass(element, name);
          await until(() => isIn({ a: 0, b: 1, c: 2 }[name]!), 'the room in the headset');
        } else {
          await passByKeys(element, name);
          await atRest(element);
        }
        if (i % 4 === 3) bytes.push(holdings().bytes);
      }
      observer.disconnect();
      const asked = await scenesAsked();
      console.log(
        `60 crossings in a ${place}: ${asked.length} requests (${asked.join()}), ${bytes.join()} bytes on the GPU, ${longTasks} tasks above 50 ms`,
      );
      assertEqual(element.getAttribute('vr-status'), place === 'headset' ? 'session-started' : null, 'status');
      assertEqual(
        asked.sort(),
        ['a', 'b', 'c'].map((name) => `${name}.splat`),
        'requests',
      );
      // A single count may meet a frame that is being drawn.
      assert(Math.min(...bytes.slice(-5)) <= Math.min(...bytes.slice(1, 4)), `memory grows: ${bytes.join()}`);
      if (place === 'headset') await leaveVr(element);
    });
});
