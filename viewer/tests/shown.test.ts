// What is read: numbers as text, curves, colours.

import assert from "node:assert/strict";
import test from "node:test";
import { format } from "../src/dom";
import { PLOTS } from "../src/plots";
import { tensionColour, theme } from "../src/theme";
import { flight, near } from "./flights";

const plot = (title: string) => PLOTS.find((found) => found.title === title)!;

test("numbers have their digits, and what is unknown is a dash", () => {
  assert.deepEqual([format(1.005), format(-0.25, 1), format(12, 0)], ["1.00", "-0.3", "12"]);
  for (const value of [NaN, Infinity, -Infinity]) assert.equal(format(value), "\u2013");
});

test("few drones have a curve each and one of what was wanted; many have extremes", () => {
  const labels = (n: number) => plot("Tension").lines(flight(n, [[0, {}]])).map((line) => line.label);
  assert.deepEqual(labels(2), ["0", "1", "0 wanted", "1 wanted"]);
  assert.deepEqual(labels(13), ["largest", "smallest"]);
});

test("extremes leave out drones that are gone", () => {
  const tensions = Float32Array.from({ length: 13 }, (_, i) => (i === 12 ? NaN : i + 1));
  const made = flight(13, [[0, { tensions }], [1, { tensions: new Float32Array(13).fill(NaN) }]]);
  const [largest, smallest] = plot("Tension").lines(made);
  assert.deepEqual([largest!.values(0), smallest!.values(0)], [12, 1]);
  assert.deepEqual([largest!.values(1), smallest!.values(1)], [NaN, NaN]);
});

test("lengths are read in centimetres and solve times in microseconds", () => {
  const made = flight(1, [[0, { load: [0.03, 0, 1.04], reference: [0, 0, 1], solve_time: [2.5e-5] }]]);
  const distance = plot("Distance from reference").lines(made).map((line) => line.values(0));
  assert(near(distance, [5, 3, 0, 4], 1e-4));
  assert(near([plot("Solve time").summary(made)(0)], [25], 1e-4));
});

test("angles of few drones have a curve a pair, of its own two cables", () => {
  const directions = [1, 0, 0, 0, 1, 0, 0, Math.SQRT1_2, Math.SQRT1_2];
  const [smallest, ...pairs] = plot("Angle between cables").lines(flight(3, [[0, { directions }]]));
  assert(near([smallest!.values(0)], [45], 1e-4));
  assert.deepEqual(pairs.map((line) => line.label), ["0-1", "0-2", "1-2"]);
  assert(near(pairs.map((line) => line.values(0)), [90, 90, 45], 1e-4));
});

test("a limit is drawn where one was asked for", () => {
  const limit = (asked: number | null) => plot("Angle between cables").limit!(flight(2, [], { safe_angle_deg: asked }));
  assert.deepEqual([limit(30), limit(0), limit(null)], [30, 0, undefined]);
});

test("colours of tension begin and end with the scale, and go no further", () => {
  const { palette } = theme;
  const hex = (part: number): string => `#${tensionColour(part, palette).getHexString()}`;
  assert.deepEqual([hex(-1), hex(0), hex(0.25), hex(1), hex(7)], [0, 0, 1, 4, 4].map((k) => palette.tension[k]));
  assert.equal(hex(NaN), palette.unknown);
});

test("drones that share a colour differ in their line, as far as there are lines", () => {
  const styles = Array.from({ length: 8 }, (_, i) => theme.drone(i));
  assert.equal(new Set(styles.map(({ colour, dash }) => `${colour} ${dash.join()}`)).size, 8);
});
