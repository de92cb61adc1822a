// The one time of the page, with pictures that the test takes.

import assert from "node:assert/strict";
import test from "node:test";
import { Clock, SPEEDS } from "../src/clock";

let waiting: ((now: number) => void)[] = [];
globalThis.requestAnimationFrame = (next) => waiting.push(next);

/** The next picture is drawn at a time, ms. */
function picture(now: number): void {
  const due = waiting;
  waiting = [];
  for (const next of due) next(now);
}

function clock(end = 10): Clock {
  waiting = [];
  const made = new Clock();
  made.span(0, end);
  return made;
}

test("time stays within its range", () => {
  const made = clock();
  const seen = [-5, 3, 50].map((time) => (made.seek(time), made.time));
  assert.deepEqual(seen, [0, 3, 10]);
  made.span(0, 4);
  assert.equal(made.time, 4);
});

test("playing takes the time between two pictures, times the speed", () => {
  const made = clock();
  made.setSpeed(2);
  made.play(true);
  picture(5000); // the first one has none before it
  assert.equal(made.time, 0);
  picture(5250);
  assert.equal(made.time, 0.5);
  made.play(false);
  picture(9000);
  assert.equal(made.time, 0.5);
});

test("it stops at the end, and plays again from the start", () => {
  const made = clock(1);
  made.play(true);
  picture(1);
  picture(9999);
  assert.deepEqual([made.time, made.playing, waiting.length], [1, false, 0]);
  made.play();
  assert.deepEqual([made.time, made.playing], [0, true]);
});

test("live, it follows the end until somebody looks back", () => {
  const made = clock(5);
  made.live = made.following = true;
  made.span(0, 6);
  assert.equal(made.time, 6);
  made.seek(2);
  made.span(0, 7);
  assert.deepEqual([made.time, made.following], [2, false]);
  made.seek(7);
  made.span(0, 8);
  assert.deepEqual([made.time, made.following], [8, true]);
});

test("speeds go up and down by one, and no further than there are", () => {
  const made = clock();
  made.faster(1);
  assert.equal(made.speed, 2);
  for (const _ of SPEEDS) made.faster(1);
  assert.equal(made.speed, SPEEDS.at(-1));
  for (const _ of SPEEDS) made.faster(-1);
  assert.equal(made.speed, SPEEDS[0]);
});

test("whoever listens hears every change", () => {
  const made = clock();
  let heard = 0;
  made.onChange(() => (heard += 1));
  made.seek(1);
  made.setSpeed(4);
  made.span(0, 20);
  assert.equal(heard, 3);
});
