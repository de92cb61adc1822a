// Rows as a live flight sends them.

import assert from "node:assert/strict";
import test from "node:test";
import { append } from "../src/live/rows";
import type { Rows } from "../src/live/connection";
import { flight, near } from "./flights";

const message = (time: number[], signals: Rows["signals"]): Rows => ({ type: "rows", seq: 1, time, signals });

test("nested lists become rows", () => {
  const made = flight(2, []);
  append(made, message([0.5], { positions: [[[1, 2, 3], [4, 5, 6]]], tensions: [[7, 8]], solve_time: [0.25] }));
  assert.deepEqual(Array.from(made.sample(0.5).positions), [1, 2, 3, 4, 5, 6]);
  assert.deepEqual(Array.from(made.sample(0.5).tensions), [7, 8]);
  assert.equal(made.columns.solve_time.at(0), 0.25);
});

test("null is unknown: a number, a drone, a whole signal", () => {
  const made = flight(2, []);
  append(made, message([0], { positions: [[null, [4, 5, 6]]], tensions: [[null, 8]], solve_time: [null] }));
  const { positions, tensions, solve_time, load } = made.columns;
  assert.deepEqual([0, 1, 2, 3, 4, 5].map((k) => positions.at(0, k)), [NaN, NaN, NaN, 4, 5, 6]);
  assert.deepEqual([tensions.at(0, 0), tensions.at(0, 1)], [NaN, 8]);
  assert(Number.isNaN(solve_time.at(0)));
  assert(Number.isNaN(load.at(0, 2))); // not sent at all
});

test("rows that are there already are left out", () => {
  const made = flight(1, []);
  append(made, message([0, 1], { load: [[0, 0, 0], [1, 0, 0]] }));
  append(made, message([0.5, 1, 2], { load: [[9, 0, 0], [9, 0, 0], [2, 0, 0]] }));
  assert.equal(made.rows, 3);
  assert(near([0, 1, 2].map((k) => made.columns.load.at(k)), [0, 1, 2]));
});
