// Where marks stand on the track.

import assert from "node:assert/strict";
import test from "node:test";
import { FOLLOWING, KINDS, type Kind } from "../src/tables";
import { arrange } from "../src/timeline";
import { mark } from "./flights";

const part = (time: number): number => 10 * time;
const places = (events: ReturnType<typeof mark>[]): number[] => arrange(events, part, 4).map(({ place }) => place);

test("marks stand at their time", () => {
  assert.deepEqual(places([mark(1, "fault"), mark(5, "departure"), mark(9, "slack")]), [10, 50, 90]);
});

test("causes of the same time stand beside each other, in their order and within the track", () => {
  assert.deepEqual(places([mark(5, "fault"), mark(5, "departure"), mark(5.1, "descent")]), [50, 54, 58]);
  assert.deepEqual(places([mark(10, "fault"), mark(10, "outcome")]), [100, 100]);
});

test("what followed counts with the mark where it has no room", () => {
  const placed = arrange([mark(4.9, "slack"), mark(5, "fault"), mark(5.2, "angle"), mark(8, "gap")], part, 4);
  assert.deepEqual(
    placed.map(({ mark: { kind }, others }) => [kind, others]),
    [["fault", 2], ["gap", 0]],
  );
});

test("of many that followed each other closely one in a place is drawn, and none is lost", () => {
  const many = Array.from({ length: 500 }, (_, k) => mark(k / 50, "fallback"));
  const placed = arrange(many, part, 4);
  assert(placed.length <= 26);
  assert.equal(placed.reduce((sum, { others }) => sum + 1 + others, 0), 500);
});

test("every kind has a word, a shape and a tone that the styles know", () => {
  for (const [kind, { word, shape, tone }] of Object.entries(KINDS)) {
    assert(word && shape.startsWith("M"), kind);
    assert(["good", "bad", "warn", "info"].includes(tone), kind);
  }
  for (const kind of FOLLOWING) assert((kind satisfies Kind) in KINDS);
});
