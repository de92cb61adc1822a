// Flights for the tests, made by hand.

import { Flight, type FlightData, type FlightInfo, type Mark, type Packed, type Row, SIGNALS, WIDTHS } from "../src/data";

export function info(n: number, changes: Partial<FlightInfo> = {}): FlightInfo {
  return {
    name: "made",
    label: "made",
    description: "",
    level: "",
    reasons: [],
    summary: "",
    n,
    cable_lengths: Array<number>(n).fill(1),
    body: null,
    radii: Array<null>(n).fill(null),
    safe_angle_deg: null,
    safe_distance: null,
    ground: 0,
    obstacles: [],
    weight: 2,
    thrust: 5,
    facts: {},
    metrics: [],
    mission: "",
    ...changes,
  };
}

/** Zeros, but for the signals that are given. */
export function row(n: number, given: Partial<Row> = {}): Row {
  return Object.fromEntries(SIGNALS.map((name) => [name, given[name] ?? new Float32Array(WIDTHS[name](n))])) as Row;
}

/** A flight of rows at these times. */
export function flight(n: number, rows: [number, Partial<Row>][], changes: Partial<FlightInfo> = {}): Flight {
  const made = new Flight(info(n, changes));
  for (const [time, given] of rows) made.append(time, row(n, given));
  return made;
}

/** Numbers as the package packs them. */
export function packed(values: Float32Array | Float64Array): Packed {
  const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
  return { shape: [values.length], data: btoa(String.fromCharCode(...bytes)) };
}

/** What a page carries of a flight whose k-th row of a signal is `value(name, k)` everywhere. */
export function carried(n: number, times: number[], value: (name: string, k: number) => number): FlightData {
  const signals = Object.fromEntries(
    SIGNALS.map((name) => {
      const width = WIDTHS[name](n);
      const all = times.flatMap((_, k) => Array<number>(width).fill(value(name, k)));
      return [name, packed(Float32Array.from(all))];
    }),
  );
  return { ...info(n), events: [], time: packed(Float64Array.from(times)), signals };
}

export const mark = (time: number, kind: Mark["kind"], text = ""): Mark => ({ time, kind, text, drone: null });

export function near(actual: ArrayLike<number>, expected: number[], tolerance = 1e-6): boolean {
  return actual.length === expected.length && expected.every((value, k) => Math.abs(actual[k]! - value) <= tolerance);
}
