/** Changes that a framework makes to an element and its children. */
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { boxGlb } from '../../../element/browser/support/glb.js';
import { assert, assertEqual, COMPASS, FIXTURES, frames, until } from '../../../element/browser/support/harness.js';
import { isGreen, isRed, screenOf } from '../../../element/browser/support/screen.js';

export interface Child {
  readonly name: string;
  readonly kind: 'scene' | 'mesh';
  readonly src: string | Blob;
  readonly position?: readonly number[];
  readonly hidden?: boolean;
}

export interface Rendering {
  render(children: readonly Child[]): unknown;
  unmount(): void;
}

interface App {
  readonly GaussianSplatElement: { workerLocation: string | null };
  mount(place: HTMLElement, attributes: object, report: (name: string, what: string) => void): Rendering;
}

const GREEN = `${FIXTURES}green.splat`;

/** @param script of an app that exports `mount` */
export function describeScenes(name: string, script: string, toAttributes: (properties: object) => object): void {
  describe(`children of the element in ${name}`, () => {
    it('are added, moved, reordered, swapped and removed', async () => {
      const { mount, GaussianSplatElement } = (await import(/* @vite-ignore */ script)) as App;
      GaussianSplatElement.workerLocation = '/packages/element/dist/loading/scene-worker.js';
      const place = document.createElement('div');
      document.body.append(place);
      const reported: string[] = [];
      const common = { translate: 'no', draggable: 'false' };
      const view = {
        ...common,
        cameraOrbit: '0deg 90deg 10m',
        cameraTarget: '0 0 0',
        fieldOfView: '45deg',
        loading: 'eager',
      };
      const attributes = toAttributes({ ...view, style: { display: 'block', width: '120px', height: '100px' } });
      const app = mount(place, attributes, (child, what) => reported.push(`${child} ${what}`));
      const green: Child = { name: 'green', kind: 'scene', src: GREEN, position: [-2, 0, 0] };
      const box: Child = { name: 'box', kind: 'mesh', src: boxGlb(), position: [2, 0, 0] };
      await app.render([green, box]);
      await until(() => reported.length === 2, 'both');
      assertEqual([...reported].sort(), ['box load', 'green load'], 'events');
      const element = place.firstElementChild as HTMLElement;
      assertEqual([element.translate, element.draggable], [false, false], 'common attributes');
      const at = async (isPicked: typeof isRed): Promise<number | null> => {
        await frames(3);
        const middle = (await screenOf(place.firstElementChild!)).middleOf(isPicked);
        return middle && Math.round((middle.x - 60) / 12.07);
      };
      assertEqual([await at(isGreen), await at(isRed)], [-2, 2], 'places');
      const move = (child: Child, x: number): Child => ({ ...child, position: [x, 0, 0] });
      await app.render([move(box, -2), move(green, 1)]);
      assertEqual([await at(isGreen), await at(isRed)], [1, -2], 'moved and reordered');
      assertEqual(reported.length, 2, 'nothing is loaded again');
      await app.render([{ ...box, hidden: true }, green]);
      assertEqual([await at(isGreen), await at(isRed)], [-2, null], 'hidden');
      await app.render([
        box,
        { ...green, src: COMPASS },
        { name: 'missing', kind: 'scene', src: '/net/missing.splat' },
      ]);
      await until(() => reported.includes('missing network/status') && reported.length === 4, 'what was swapped');
      assertEqual(reported.slice(2).sort(), ['green load', 'missing network/status'], 'events of the swap');
      await app.render([box]);
      assertEqual([await at(isGreen), await at(isRed)], [null, 2], 'removed');
      app.unmount();
      assert(place.childElementCount === 0, 'unmounted');
    });

    it('a rendering leaves the scene to which a door has led', async () => {
      const { mount } = (await import(/* @vite-ignore */ script)) as App;
      const place = document.createElement('div');
      document.body.append(place);
      const app = mount(place, toAttributes({ src: COMPASS, walkMap: 'auto', loading: 'eager' }), () => undefined);
      await app.render([]);
      const element = place.firstElementChild as GaussianSplatElement;
      await until(() => element.loaded, 'the first room');
      Object.assign(element, { src: GREEN, walkMap: 'green.floor' });
      await app.render([]);
      await frames(3);
      assertEqual([element.src, element.walkMap], [GREEN, 'green.floor'], 'scene and map');
      app.unmount();
    });
  });
}
