// A flight as rows of numbers. Replay fills it at once, live appends to it; everything else only reads.

import { type Kind, type Level, MOST_PAIRED } from "./tables";

/** A moment of a flight. */
export interface Mark {
  time: number;
  kind: Kind;
  text: string;
  drone: number | null;
}

export interface Packed {
  shape: number[];
  data: string;
}

export interface Metric {
  name: string;
  meaning: string;
  unit: string;
  value: number | null;
}

/** A rigid load, in its own frame, m. */
export interface Body {
  size: number[];
  attachments: number[][];
}

export interface FlightInfo {
  name: string;
  label: string;
  description: string;
  /** The verdict; none before there is one. */
  level: Level | "";
  reasons: string[];
  summary: string;
  n: number;
  cable_lengths: number[];
  /** From a drone's centre to its outermost tip, m, where that is known. */
  radii: (number | null)[];
  /** The load, unless it is a point. */
  body: Body | null;
  /** Height of the ground, m, where there is one. */
  ground: number | null;
  /** What stands in the way: rows of eight numbers (colift.team.obstacles). */
  obstacles: number[][];
  /** Least angle that was asked for, if any was. */
  safe_angle_deg: number | null;
  /** Least distance of two drones that was asked for, if any was, m. */
  safe_distance: number | null;
  /** Weight of the load and mean thrust of a drone, N: they set the length of arrows. */
  weight: number;
  thrust: number;
  facts: Record<string, string>;
  metrics: Metric[];
  mission: string;
}

export interface FlightData extends FlightInfo {
  events: Mark[];
  time: Packed;
  signals: Record<string, Packed>;
}

export interface Payload {
  format: number;
  flights: FlightData[];
  view: { theme?: string; camera?: string; bare?: boolean };
}

/** Rows of equal width in one growing array. */
export class Column {
  rows = 0;
  constructor(
    readonly width: number,
    public data: Float32Array | Float64Array = new Float32Array(64 * width),
  ) {}

  static of(width: number, data: Float32Array | Float64Array): Column {
    const column = new Column(width, data);
    column.rows = data.length / width;
    return column;
  }

  push(values: ArrayLike<number>): void {
    const end = (this.rows + 1) * this.width;
    if (end > this.data.length) {
      const grown = this.data instanceof Float64Array ? new Float64Array(2 * end) : new Float32Array(2 * end);
      grown.set(this.data);
      this.data = grown;
    }
    this.data.set(values, this.rows * this.width);
    this.rows += 1;
  }

  at(row: number, k = 0): number {
    return this.data[row * this.width + k]!;
  }
}

/** Every signal of a row, and its width for n drones. */
export const WIDTHS = {
  reference: () => 3,
  load: () => 3,
  force: () => 3,
  external: () => 3,
  positions: (n: number) => 3 * n,
  attitudes: (n: number) => 4 * n,
  directions: (n: number) => 3 * n,
  tensions: (n: number) => n,
  desired_tensions: (n: number) => n,
  thrusts: (n: number) => n,
  reeled: (n: number) => n,
  load_attitude: () => 4,
  reference_attitude: () => 4,
  solve_time: () => 1,
  status: () => 1,
};

export type Signal = keyof typeof WIDTHS;
/** Signals that the page computes from a row. */
export type Derived = "error" | "turned" | "angle" | "apart" | "spin";

export const SIGNALS = Object.keys(WIDTHS) as Signal[];
export type Row = Record<Signal, ArrayLike<number>>;
export type Frame = Record<Signal | Derived, Float32Array> & {
  time: number;
  row: number;
  n: number;
  /** Where each cable ends on the load. */
  ends: Float32Array;
};

export class Flight {
  readonly time = new Column(1, new Float64Array(64));
  readonly columns: Record<Signal | Derived, Column>;
  events: Mark[] = [];
  /** Where the pilot drags the load to, while he does. */
  target: [number, number, number] | null = null;
  /** Grows with every change of the rows. */
  version = 0;
  /** End of the colour scale of tension, N: twice a cable's share of the load, the same however it flies. */
  readonly full: number;

  constructor(readonly info: FlightInfo) {
    this.full = (2 * info.weight) / info.n || 1;
    const columns = { error: new Column(1), turned: new Column(1), angle: new Column(1), apart: new Column(1), spin: new Column(info.n) } as Flight["columns"];
    for (const name of SIGNALS) columns[name] = new Column(WIDTHS[name](info.n));
    this.columns = columns;
  }

  static unpack(data: FlightData): Flight {
    const flight = new Flight(data);
    const time = new Float64Array(bytes(data.time.data));
    const given = SIGNALS.map((name) => new Float32Array(bytes(data.signals[name]!.data)));
    for (let row = 0; row < time.length; row++) {
      const values = {} as Row;
      SIGNALS.forEach((name, k) => {
        const width = WIDTHS[name](data.n);
        values[name] = given[k]!.subarray(row * width, (row + 1) * width);
      });
      flight.append(time[row]!, values);
    }
    flight.events = data.events;
    return flight;
  }

  get n(): number {
    return this.info.n;
  }
  get rows(): number {
    return this.time.rows;
  }
  get start(): number {
    return this.rows ? this.time.at(0) : 0;
  }
  get end(): number {
    return this.rows ? this.time.at(this.rows - 1) : 0;
  }

  append(time: number, values: Row): void {
    const { columns, n } = this;
    const step = this.rows ? time - this.end : 0;
    for (const name of SIGNALS) columns[name].push(values[name]);
    const { load, reference, directions, thrusts } = values;
    columns.error.push([Math.hypot(load[0]! - reference[0]!, load[1]! - reference[1]!, load[2]! - reference[2]!)]);
    columns.turned.push([this.info.body ? turnOf(values.load_attitude, values.reference_attitude) : NaN]);
    columns.angle.push([n > MOST_PAIRED ? NaN : closest(directions, n).angle]);
    columns.apart.push([n > MOST_PAIRED ? NaN : nearest(values.positions, n).distance]);
    const spin = new Float32Array(n);
    for (let i = 0; i < n; i++) {
      const before = this.rows ? columns.spin.at(this.rows - 1, i) : i;
      // The rotors turn slower than real ones, so that the eye can follow them.
      const rate = Number.isFinite(thrusts[i]) ? 8 * Math.sqrt(Math.max(thrusts[i]!, 0) / 5) : 8;
      spin[i] = (before + rate * step) % (200 * Math.PI);
    }
    columns.spin.push(spin);
    this.time.push([time]);
    this.version += 1;
  }

  clear(): void {
    this.time.rows = 0;
    for (const column of Object.values(this.columns)) column.rows = 0;
    this.events = [];
    this.version += 1;
  }

  /** Last row at or before a time. */
  rowAt(time: number): number {
    let low = 0;
    let high = this.rows - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.time.at(middle) <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** The state at a time, between two rows by straight lines; what one of the two lacks is the earlier's. */
  sample(time: number): Frame {
    const row = this.rowAt(time);
    const next = Math.min(row + 1, this.rows - 1);
    const span = this.time.at(next) - this.time.at(row);
    const part = span > 0 ? Math.min(Math.max((time - this.time.at(row)) / span, 0), 1) : 0;
    const frame = { time, row, n: this.n } as Frame;
    for (const name of Object.keys(this.columns) as (Signal | Derived)[]) {
      const { width, data } = this.columns[name];
      const values = new Float32Array(width);
      for (let k = 0; k < width; k++) {
        const a = data[row * width + k]!;
        const b = data[next * width + k]!;
        const mixed = a + part * (b - a);
        values[k] = Number.isNaN(mixed) || (name === "spin" && b < a) ? a : mixed;
      }
      frame[name] = values;
    }
    if (part > 0) {
      for (const name of ["attitudes", "load_attitude", "reference_attitude"] as const)
        turn(frame[name], this.columns[name], row, next, part);
    }
    frame.ends = ends(frame, this.info.body);
    frame.status[0] = this.columns.status.at(row);
    return frame;
  }
}

/** Where the cables end on the load: on a point all in one place. */
function ends(frame: Frame, body: Body | null): Float32Array {
  const found = new Float32Array(3 * frame.n);
  const [w, x, y, z] = frame.load_attitude as unknown as [number, number, number, number];
  for (let i = 0; i < frame.n; i++) {
    const [a, b, c] = (body?.attachments[i] ?? [0, 0, 0]) as [number, number, number];
    // v + 2 w (q x v) + 2 q x (q x v)
    const [e, f, g] = body ? [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)] : [0, 0, 0];
    const turned = body
      ? [a + w * e + y * g - z * f, b + w * f + z * e - x * g, c + w * g + x * f - y * e]
      : [0, 0, 0];
    for (let k = 0; k < 3; k++) found[3 * i + k] = frame.load[k]! + turned[k]!;
  }
  return found;
}

/** Where cable i ends on the load. */
export function cableEnd(frame: Frame, i: number): ArrayLike<number> {
  return frame.ends.subarray(3 * i, 3 * i + 3);
}

/** Attitudes between two rows: quaternions of opposite sign are the same attitude. */
function turn(out: Float32Array, column: Column, row: number, next: number, part: number): void {
  for (let i = 0; i < out.length; i += 4) {
    let dot = 0;
    for (let k = i; k < i + 4; k++) dot += column.at(row, k) * column.at(next, k);
    if (Number.isNaN(dot)) continue;
    const other = dot < 0 ? -part : part;
    let norm = 0;
    for (let k = i; k < i + 4; k++) {
      out[k] = (1 - part) * column.at(row, k) + other * column.at(next, k);
      norm += out[k]! ** 2;
    }
    for (let k = i; k < i + 4; k++) out[k]! /= Math.sqrt(norm) || 1;
  }
}

/** Angle of the turn from one attitude to another, deg. */
export function turnOf(q: ArrayLike<number>, p: ArrayLike<number>): number {
  const [w, x, y, z] = q as unknown as [number, number, number, number];
  const [a, b, c, d] = p as unknown as [number, number, number, number];
  // Imaginary part of q p*: exact for small angles, where the real part says nothing.
  const across = Math.hypot(x * a - w * b - y * d + z * c, y * a - w * c - z * b + x * d, z * a - w * d - x * c + y * b);
  return (2 * Math.atan2(across, Math.abs(w * a + x * b + y * c + z * d)) * 180) / Math.PI;
}

export interface Gap {
  one: number;
  other: number;
  distance: number;
}

/** The two drones that are nearest to each other, m; NaN when there are no two. */
export function nearest(positions: ArrayLike<number>, n: number): Gap {
  const found: Gap = { one: -1, other: -1, distance: NaN };
  for (let i = 0; i < n; i++) {
    for (let j = i + 1; j < n; j++) {
      const distance = Math.hypot(...[0, 1, 2].map((k) => positions[3 * i + k]! - positions[3 * j + k]!));
      if (distance < found.distance || (Number.isNaN(found.distance) && !Number.isNaN(distance)))
        Object.assign(found, { one: i, other: j, distance });
    }
  }
  return found;
}

/** Where two cables come nearest to each other. */
export interface Clearance extends Gap {
  /** On the one and on the other, m. */
  points: [number[], number[]];
}

/** The two cables that are nearest to each other, as straight lines from drone to end; NaN when there are no two. */
export function nearestCables(positions: ArrayLike<number>, ends: ArrayLike<number>, n: number): Clearance {
  const found: Clearance = { one: -1, other: -1, distance: NaN, points: [[], []] };
  const at = (from: ArrayLike<number>, i: number): number[] => [0, 1, 2].map((k) => from[3 * i + k]!);
  const less = (a: number[], b: number[]): number[] => a.map((value, k) => value - b[k]!);
  const dot = (a: number[], b: number[]): number => a.reduce((sum, value, k) => sum + value * b[k]!, 0);
  const along = (a: number[], way: number[], share: number): number[] => a.map((value, k) => value + share * way[k]!);
  const within = (share: number): number => Math.min(Math.max(share, 0), 1);
  for (let i = 0; i < n; i++) {
    for (let j = i + 1; j < n; j++) {
      const [a, b] = [at(positions, i), at(positions, j)];
      const [u, v] = [less(at(ends, i), a), less(at(ends, j), b)];
      const [uu, uv, vv, apart] = [dot(u, u), dot(u, v), dot(v, v), less(a, b)];
      const [ua, va, sine] = [dot(u, apart), dot(v, apart), dot(u, u) * dot(v, v) - dot(u, v) ** 2];
      if (!(uu > 0 && vv > 0)) continue;
      // The nearest points of the lines, then each moved to where its segment comes nearest to the other's point.
      let s = sine > 1e-9 * uu * vv ? within((uv * va - vv * ua) / sine) : 0;
      const t = within((uv * s + va) / vv);
      s = within((uv * t - ua) / uu);
      const points: [number[], number[]] = [along(a, u, s), along(b, v, t)];
      const distance = Math.hypot(...less(points[0], points[1]));
      if (distance < found.distance || Number.isNaN(found.distance)) Object.assign(found, { one: i, other: j, distance, points });
    }
  }
  return found;
}

export interface Pair {
  one: number;
  other: number;
  angle: number;
}

export function angleBetween(directions: ArrayLike<number>, i: number, j: number): number {
  const [a, b, c] = [directions[3 * i]!, directions[3 * i + 1]!, directions[3 * i + 2]!];
  const [d, e, f] = [directions[3 * j]!, directions[3 * j + 1]!, directions[3 * j + 2]!];
  const cross = Math.hypot(b * f - c * e, c * d - a * f, a * e - b * d);
  return (Math.atan2(cross, a * d + b * e + c * f) * 180) / Math.PI;
}

/** The pair of cables with the smallest angle, deg; NaN when there is none. */
export function closest(directions: ArrayLike<number>, n: number): Pair {
  const found: Pair = { one: -1, other: -1, angle: NaN };
  for (let i = 0; i < n; i++) {
    for (let j = i + 1; j < n; j++) {
      const angle = angleBetween(directions, i, j);
      if (angle < found.angle || (Number.isNaN(found.angle) && !Number.isNaN(angle)))
        Object.assign(found, { one: i, other: j, angle });
    }
  }
  return found;
}

function bytes(text: string): ArrayBuffer {
  const raw = atob(text);
  const buffer = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) buffer[k] = raw.charCodeAt(k);
  return buffer.buffer;
}
