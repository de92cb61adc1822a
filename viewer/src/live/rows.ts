// Rows as the server sends them become rows of a flight.

import { type Flight, type Row, SIGNALS, WIDTHS } from "../data";
import type { Rows } from "./connection";

type Numbers = number | null | Numbers[];

/** Fill `out` from nested lists; null is unknown, also for a whole drone. */
function fill(out: Float32Array, value: Numbers | undefined): Float32Array {
  out.fill(NaN);
  if (typeof value === "number") out[0] = value;
  if (!Array.isArray(value)) return out;
  const width = out.length / value.length;
  value.forEach((part, k) => {
    if (part !== null) fill(out.subarray(k * width, (k + 1) * width), part);
  });
  return out;
}

/** Append the rows that are later than all before. */
export function append(flight: Flight, message: Rows): void {
  message.time.forEach((time, k) => {
    if (flight.rows && time <= flight.end) return;
    const row = {} as Row;
    for (const name of SIGNALS)
      row[name] = fill(new Float32Array(WIDTHS[name](flight.n)), message.signals[name]?.[k]);
    flight.append(time, row);
  });
}
