/** Rooms and doors: what their attributes say, where visitors arrive, and how rooms lie on the plan. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { arrivalAt, backOf, onPlan, placeRooms, type Door } from '../../packages/element/src/features/doors/rooms.js';

const door = (room: string, to: string, [x, z]: readonly [number, number], degrees: number): Door => ({
  ...{ element: {} as HTMLElement, room, to, position: [x, 1.6, z], floorMap: null },
  heading: (degrees * Math.PI) / 180,
  view: ((degrees + 180) * Math.PI) / 180,
});
const near = (found: readonly number[], expected: readonly number[]): void =>
  found.forEach((value, k) =>
    assert.ok(Math.abs(value - expected[k]) < 1e-9, `${found.join()}, not ${expected.join()}`),
  );

// Hall: one leaves it to -z at (2, -3), and to -x at (-4, 0). Each room has axes of its own.
const ALL = [
  door('hall', 'kitchen', [2, -3], 0),
  door('kitchen', 'hall', [1, 1], 90),
  door('hall', 'study', [-4, 0], 90),
  door('study', 'hall', [0, 5], 0),
  door('kitchen', 'garden', [-2, 0], 180),
];

test('visitors arrive a meter before the door that leads back, with their back to it', () => {
  const back = backOf(ALL[0], ALL)!;
  assert.equal(back, ALL[1]);
  // One leaves the kitchen to -x, so one arrives further to +x and looks there.
  const { eye, heading } = arrivalAt(back, 1);
  near(eye, [2, 1.6, 1]);
  near([-Math.sin(heading), -Math.cos(heading)], [1, 0]);
  near(arrivalAt(back, 0.5).eye, [3, 1.6, 1]);
  assert.equal(arrivalAt({ ...back, view: 0.3 }, 1).heading, 0.3, 'or where the door says');
  assert.equal(backOf(ALL[4], ALL), undefined);
});

test('both sides of a door are at one point of the plan, and lead opposite ways', () => {
  for (const unit of [1, 0.5]) {
    const placed = placeRooms('hall', ALL, unit);
    assert.deepEqual([...placed.keys()], ['hall', 'kitchen', 'study']);
    for (const side of ALL.slice(0, 4)) {
      const back = backOf(side, ALL)!;
      const at = ({ room, position }: Door): number[] =>
        onPlan(placed.get(room)!, [unit * position[0], unit * position[2]]);
      near(at(side), at(back));
      const way = ({ room, heading }: Door): number => heading + placed.get(room)!.turn;
      near([Math.cos(way(side) - way(back))], [-1]);
    }
  }
  // The kitchen is turned: what is +x there is -z in the hall.
  near(onPlan(placeRooms('hall', ALL, 1).get('kitchen')!, [2, 1]), [2, -4]);
});
