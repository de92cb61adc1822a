// Rows of a flight: unpacked, appended, looked up, and between two of them.

import assert from "node:assert/strict";
import test from "node:test";
import { angleBetween, closest, Column, Flight, nearest, nearestCables, SIGNALS, turnOf, WIDTHS } from "../src/data";
import { MOST_PAIRED } from "../src/tables";
import { carried, flight, near } from "./flights";

test("a payload unpacks to its numbers, row by row", () => {
  const value = (name: string, k: number): number => 10 * SIGNALS.indexOf(name as never) + k;
  const unpacked = Flight.unpack(carried(3, [0, 0.1, 1e6 + 0.3], value));
  assert.equal(unpacked.rows, 3);
  assert.deepEqual([0, 1, 2].map((k) => unpacked.time.at(k)), [0, 0.1, 1e6 + 0.3]);
  for (const name of SIGNALS)
    for (let k = 0; k < 3; k++)
      for (let i = 0; i < WIDTHS[name](3); i++) assert.equal(unpacked.columns[name].at(k, i), value(name, k), name);
});

test("what is unknown in a payload stays unknown", () => {
  const unpacked = Flight.unpack(carried(2, [0, 1], (name) => (name === "tensions" ? NaN : 1)));
  assert(Number.isNaN(unpacked.columns.tensions.at(1, 1)));
  assert(Number.isNaN(unpacked.sample(0.5).tensions[0]));
});

test("a column keeps its rows as it grows", () => {
  const column = new Column(3);
  for (let k = 0; k < 1000; k++) column.push([k, 1 - k, 0.5]);
  assert.equal(column.rows, 1000);
  for (const k of [0, 63, 64, 999]) assert.deepEqual([0, 1, 2].map((i) => column.at(k, i)), [k, 1 - k, 0.5]);
});

test("the row of a time is the last one at or before it", () => {
  const made = flight(1, [[1, {}], [1.5, {}], [4, {}]]);
  assert.deepEqual([0, 1, 1.49, 1.5, 3.9, 4, 99].map((time) => made.rowAt(time)), [0, 0, 0, 1, 1, 2, 2]);
  assert.deepEqual([made.start, made.end], [1, 4]);
});

test("between two rows lies a straight line, and outside of them the nearest row", () => {
  const made = flight(1, [[0, { load: [0, 0, 1] }], [2, { load: [4, -2, 1] }]]);
  assert(near(made.sample(0.5).load, [1, -0.5, 1]));
  assert(near(made.sample(-3).load, [0, 0, 1]));
  assert(near(made.sample(9).load, [4, -2, 1]));
});

test("the allocator's status is that of the earlier row, not a mean", () => {
  const made = flight(1, [[0, { status: [1] }], [1, { status: [7] }]]);
  assert.deepEqual([0, 0.99, 1].map((time) => made.sample(time).status[0]), [1, 1, 7]);
});

test("what the later row lacks is the earlier's", () => {
  const made = flight(2, [[0, { tensions: [1, 2] }], [1, { tensions: [3, NaN] }]]);
  assert(near(made.sample(0.5).tensions, [2, 2]));
  assert(Number.isNaN(made.sample(1).tensions[1]));
});

test("attitudes turn the short way and stay of length one", () => {
  const half = Math.SQRT1_2;
  const made = flight(1, [[0, { attitudes: [1, 0, 0, 0] }], [1, { attitudes: [-half, 0, 0, -half] }]]);
  const [w, x, y, z] = made.sample(0.5).attitudes;
  assert(near([w!, x!, y!, z!], [Math.cos(Math.PI / 8), 0, 0, Math.sin(Math.PI / 8)]));
});

test("the error is the distance of the load from its reference", () => {
  const made = flight(1, [[0, { load: [1, 2, 3], reference: [1, 5, 7] }]]);
  assert.equal(made.columns.error.at(0), 5);
});

test("rotors turn on from row to row, faster with more thrust, and on when it is unknown", () => {
  const made = flight(3, [[0, {}], [0.1, { thrusts: [5, 20, NaN] }]]);
  const turned = [0, 1, 2].map((i) => made.columns.spin.at(1, i) - made.columns.spin.at(0, i));
  assert(near(turned, [0.8, 1.6, 0.8]));
});

test("a flight that is cleared is as new", () => {
  const made = flight(2, [[0, {}], [5, {}]]);
  const before = made.version;
  made.clear();
  assert.deepEqual([made.rows, made.start, made.end, made.events.length], [0, 0, 0, 0]);
  assert(made.version > before);
});

test("angles are right where a cosine would lose them", () => {
  const small = 1e-4;
  assert(near([angleBetween([1, 0, 0, Math.cos(small), Math.sin(small), 0], 0, 1)], [(small * 180) / Math.PI], 1e-9));
  assert(near([angleBetween([1, 0, 0, -2, 0, 0], 0, 1)], [180]));
});

test("the closest pair is found among cables of which one is unknown", () => {
  const directions = [0, 0, -1, NaN, NaN, NaN, 1, 0, 0, Math.SQRT1_2, 0, -Math.SQRT1_2 / 1.1];
  const { one, other, angle } = closest(directions, 4);
  assert.deepEqual([one, other], [2, 3]);
  assert(angle > 42 && angle < 45);
  assert(Number.isNaN(closest([0, 0, -1], 1).angle));
  assert(Number.isNaN(closest([NaN, NaN, NaN, 0, 0, -1], 2).angle));
});

test("pairs of very many drones are not looked at", () => {
  assert(Number.isFinite(flight(MOST_PAIRED, [[0, {}]]).columns.angle.at(0)));
  assert(Number.isNaN(flight(MOST_PAIRED + 1, [[0, {}]]).columns.angle.at(0)));
});

test("the turn from one attitude to another has its angle, whatever the signs and however small", () => {
  const about = (angle: number, x: number, y: number, z: number) => [Math.cos(angle / 2), ...[x, y, z].map((part) => part * Math.sin(angle / 2))];
  const tilted = about(0.5, 0.6, 0, 0.8);
  for (const angle of [1e-6, 0.3, 2.9]) {
    // The second one turned by the angle about the vertical.
    const [c, , , s] = about(angle, 0, 0, 1) as [number, number, number, number];
    const [w, x, y, z] = tilted as [number, number, number, number];
    const further = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w];
    assert(near([turnOf(further, tilted)], [(angle * 180) / Math.PI], 1e-9 + 1e-9 * angle));
    assert(near([turnOf(further.map((part) => -part), tilted)], [(angle * 180) / Math.PI], 1e-9 + 1e-9 * angle));
  }
});

test("the nearest two drones are found, without those that are gone", () => {
  const positions = [0, 0, 0, 3, 0, 4, 0, 1, 0, NaN, NaN, NaN];
  assert.deepEqual(nearest(positions, 4), { one: 0, other: 2, distance: 1 });
  assert(Number.isNaN(nearest(positions, 1).distance));
});

test("two cables are as far apart as their nearest points, at ends and in between", () => {
  // Crossed at 0.3 m, in their middles; then side by side; then end to end.
  const crossed = nearestCables([-1, 0, 0, 0, -1, 0.3], [1, 0, 0, 0, 1, 0.3], 2);
  assert(near([crossed.distance, ...crossed.points[0], ...crossed.points[1]], [0.3, 0, 0, 0, 0, 0, 0.3], 1e-12));
  assert(near([nearestCables([0, 0, 1, 0.4, 0, 1], [0, 0, 0, 0.4, 0, 0], 2).distance], [0.4], 1e-12));
  assert(near([nearestCables([0, 0, 0, 5, 0, 0], [1, 0, 0, 3, 0, 0], 2).distance], [2], 1e-12));
  // Leaning away from each other: nearest at their lower ends, those of the first two of three.
  const three = nearestCables([-1, 0, 1, 1, 0, 1, 0, 9, 1], [-0.2, 0, 0, 0.2, 0, 0, 0, 8, 0], 3);
  assert.deepEqual([three.one, three.other], [0, 1]);
  assert(near([three.distance], [0.4], 1e-12));
  assert(Number.isNaN(nearestCables([0, 0, 1, NaN, NaN, NaN], [0, 0, 0, NaN, NaN, NaN], 2).distance));
  assert(Number.isNaN(nearestCables([0, 0, 1], [0, 0, 0], 1).distance));
});

test("only a rigid load has an error of its attitude, only two drones have a distance", () => {
  const turned = [Math.SQRT1_2, 0, 0, Math.SQRT1_2];
  const given = { load_attitude: turned, reference_attitude: [1, 0, 0, 0], positions: [0, 0, 0, 0.5, 0, 0] };
  const body = { size: [1, 1, 1], attachments: [[0, 0, 0], [0, 0, 0]] };
  const box = flight(2, [[0, given]], { body });
  assert(near([box.columns.turned.at(0), box.columns.apart.at(0)], [90, 0.5], 1e-4));
  assert(Number.isNaN(flight(2, [[0, given]]).columns.turned.at(0)));
  assert(Number.isNaN(flight(1, [[0, {}]], { body }).columns.apart.at(0)));
});
