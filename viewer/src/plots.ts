// Plots over time. To add one, add an entry to PLOTS; it is drawn, synchronised and read on hover.

import uPlot from "uplot";
import type { Clock } from "./clock";
import { angleBetween, type Flight } from "./data";
import { el, format } from "./dom";
import type { Part } from "./panel";
import { theme } from "./theme";

interface Line {
  label: string;
  colour: string;
  dash: number[];
  width: number;
  values: (row: number) => number;
  /** Drawn, but neither named nor read. */
  quiet?: boolean;
}

interface Plot {
  title: string;
  unit: string;
  digits: number;
  /** Lines of the only flight. */
  lines: (flight: Flight) => Line[];
  /** The one line that stands for a flight beside others. */
  summary: (flight: Flight) => (row: number) => number;
  summaryTitle: string;
  /** Vertical axis in powers of ten. */
  log?: boolean;
  /** Only of rigid loads, or only of points. */
  body?: boolean;
  /** A level not to fall below, drawn across. */
  limit?: (flight: Flight) => number | undefined;
}

/** Above so many drones only a summary is drawn. */
const MANY = 12;

/** Above so many drones not every pair is drawn. */
const MANY_PAIRED = 5;

const perDrone = (flight: Flight): Line[] =>
  Array.from({ length: flight.n }, (_, i) => ({
    label: `${i}`,
    ...theme.drone(i),
    width: 1.6,
    values: (row) => flight.columns.tensions.at(row, i),
  }));

const wanted = (flight: Flight): Line[] =>
  Array.from({ length: flight.n }, (_, i) => ({
    label: `${i} wanted`,
    colour: `${theme.drone(i).colour}70`,
    dash: [],
    width: 1,
    values: (row) => flight.columns.desired_tensions.at(row, i),
    quiet: true,
  }));

/** A thin line for every two drones, of what `between` says of them. */
const everyTwo = (flight: Flight, between: (row: number, i: number, j: number) => number): Line[] => {
  if (flight.n > MANY_PAIRED) return [];
  const lines: Line[] = [];
  for (let i = 0; i < flight.n; i++)
    for (let j = i + 1; j < flight.n; j++)
      lines.push({
        label: `${i}-${j}`,
        colour: theme.palette.unknown,
        dash: [],
        width: 0.8,
        values: (row) => between(row, i, j),
        quiet: true,
      });
  return lines;
};

const pairs = (flight: Flight): Line[] => {
  const { data } = flight.columns.directions;
  return everyTwo(flight, (row, i, j) => angleBetween(data.subarray(3 * flight.n * row, 3 * flight.n * (row + 1)), i, j));
};

const gaps = (flight: Flight): Line[] => {
  const { positions } = flight.columns;
  const along = (row: number, i: number, j: number, k: number): number => positions.at(row, 3 * i + k) - positions.at(row, 3 * j + k);
  return everyTwo(flight, (row, i, j) => Math.hypot(along(row, i, j, 0), along(row, i, j, 1), along(row, i, j, 2)));
};

const over = (flight: Flight, pick: (...values: number[]) => number) => (row: number) => {
  const found: number[] = [];
  for (let i = 0; i < flight.n; i++) {
    const value = flight.columns.tensions.at(row, i);
    if (Number.isFinite(value)) found.push(value);
  }
  return found.length ? pick(...found) : NaN;
};

const single = (label: string, values: (row: number) => number): Line => ({
  label,
  colour: theme.palette.ink,
  dash: [],
  width: 1.8,
  values,
});

const axis = (flight: Flight, k: number) => (row: number) =>
  100 * (flight.columns.load.at(row, k) - flight.columns.reference.at(row, k));

export const PLOTS: Plot[] = [
  {
    title: "Tension",
    unit: "N",
    digits: 3,
    lines: (flight) =>
      flight.n <= MANY
        ? [...perDrone(flight), ...wanted(flight)]
        : [single("largest", over(flight, Math.max)), single("smallest", over(flight, Math.min))],
    summary: (flight) => over(flight, Math.max),
    summaryTitle: "Largest tension",
  },
  {
    title: "Angle between cables",
    unit: "\u00b0",
    digits: 1,
    lines: (flight) => [single("smallest", (row) => flight.columns.angle.at(row)), ...pairs(flight)],
    summary: (flight) => (row) => flight.columns.angle.at(row),
    summaryTitle: "Smallest angle between cables",
    limit: (flight) => flight.info.safe_angle_deg ?? undefined,
    body: false,
  },
  {
    title: "Distance between drones",
    unit: "m",
    digits: 2,
    lines: (flight) => [single("smallest", (row) => flight.columns.apart.at(row)), ...gaps(flight)],
    summary: (flight) => (row) => flight.columns.apart.at(row),
    summaryTitle: "Smallest distance between drones",
    limit: (flight) => flight.info.safe_distance ?? undefined,
    body: true,
  },
  {
    title: "Distance from reference",
    unit: "cm",
    digits: 2,
    lines: (flight) => [
      single("distance", (row) => 100 * flight.columns.error.at(row)),
      ...["x", "y", "z"].map((label, k) => ({ label, ...theme.drone(k), width: 1.1, values: axis(flight, k) })),
    ],
    summary: (flight) => (row) => 100 * flight.columns.error.at(row),
    summaryTitle: "Distance from reference",
  },
  {
    title: "Angle from wanted attitude",
    unit: "\u00b0",
    digits: 2,
    lines: (flight) => [single("angle", (row) => flight.columns.turned.at(row))],
    summary: (flight) => (row) => flight.columns.turned.at(row),
    summaryTitle: "Angle from wanted attitude",
    body: true,
  },
  {
    title: "Solve time",
    unit: "\u00b5s",
    digits: 1,
    lines: (flight) => [single("longest", (row) => 1e6 * flight.columns.solve_time.at(row))],
    summary: (flight) => (row) => 1e6 * flight.columns.solve_time.at(row),
    summaryTitle: "Solve time",
    log: true,
  },
];

const SYNC = "colift";
/** Least time between two drawings of curves that grow, ms. */
const PACE = 100;
const FONT = "11px system-ui, sans-serif";

/** One plot: a head with name and values at the cursor, and the curves. */
class Chart {
  readonly element = el("figure", { class: "plot" });
  private readonly host = el("div", { class: "curves" });
  private readonly head = el("figcaption");
  /** Where the clock stands: moved, so that the curves need not be drawn again. */
  private readonly now = el("div", { class: "now" });
  private chart: uPlot | null = null;
  private lines: Line[] = [];
  private values: HTMLElement[] = [];
  private version = "";
  private drawn = -Infinity;
  private hovered: number | null = null;

  constructor(
    private readonly plot: Plot,
    private readonly flights: Flight[],
    private readonly clock: Clock,
    private readonly window: number,
  ) {
    this.element.append(this.head, this.host);
    new ResizeObserver(() => this.resize()).observe(this.host);
    theme.onChange(() => this.build());
  }

  /** Follow the clock, and the rows where they have grown. */
  update(): void {
    if (!this.chart || !this.host.clientWidth) return;
    const { start, end } = this.clock;
    const version = `${start} ${end} ${this.flights.map((flight) => flight.version).join()}`;
    const now = performance.now();
    if (version !== this.version && !(this.window < Infinity && now - this.drawn < PACE)) {
      this.version = version;
      this.drawn = now;
      this.chart.setData(this.data(), false);
      this.chart.setScale("x", { min: Math.max(start, end - this.window), max: Math.max(end, start + 1e-3) });
    }
    const place = this.chart.valToPos(this.clock.time, "x");
    this.now.style.transform = `translateX(${place.toFixed(1)}px)`;
    this.now.hidden = !(place >= 0 && place <= this.chart.over.clientWidth);
    this.read();
  }

  private data(): uPlot.AlignedData {
    const tables = this.flights.map((flight, k): uPlot.AlignedData => {
      const first = flight.rows ? flight.rowAt(this.clock.end - this.window) : 0;
      const rows = Array.from({ length: flight.rows - first }, (_, row) => first + row);
      const lines = this.flights.length > 1 ? [this.lines[k]!] : this.lines;
      return [rows.map((row) => flight.time.at(row)), ...lines.map((line) => rows.map((row) => gap(line.values(row))))];
    });
    return tables.length > 1 ? uPlot.join(tables) : tables[0]!;
  }

  private build(): void {
    const { palette } = theme;
    const several = this.flights.length > 1;
    this.lines = several
      ? this.flights.map((flight, k) => ({
          label: flight.info.label,
          colour: palette.flights[k]!,
          dash: [[], [7, 3], [2, 2]][k]!,
          width: 1.8,
          values: this.plot.summary(flight),
        }))
      : this.plot.lines(this.flights[0]!);
    this.chart?.destroy();
    const grid = { stroke: palette.ground, width: 1 };
    const ticks = { show: false };
    this.chart = new uPlot(
      {
        width: Math.max(this.host.clientWidth, 200),
        height: Math.max(this.host.clientHeight, 60),
        pxAlign: false,
        legend: { show: false },
        cursor: {
          sync: { key: SYNC },
          y: false,
          points: { size: 5 },
          drag: { x: false, y: false },
          bind: {
            mousedown: (chart, _target, handler) => (event) => {
              handler(event);
              if (event.button === 0) this.clock.seek(chart.posToVal(chart.cursor.left!, "x"));
              return null;
            },
          },
        },
        padding: [6, 8, 0, 0],
        scales: { x: { time: false }, y: this.scale() },
        axes: [
          { stroke: palette.soft, grid, ticks, font: FONT, size: 22, gap: 4, values: (_chart, splits) => splits.map((t) => `${t}`) },
          { stroke: palette.soft, grid, ticks, font: FONT, size: 42, gap: 6, space: 20, values: (_chart, splits) => splits.map(short) },
        ],
        series: [
          {},
          ...this.lines.map(
            (line): uPlot.Series => ({
              label: line.label,
              stroke: line.colour,
              width: line.width,
              dash: line.dash,
              points: { show: false },
              spanGaps: several,
            }),
          ),
        ],
        hooks: {
          draw: [(chart) => this.overlay(chart)],
          setCursor: [
            (chart) => {
              this.hovered = chart.cursor.left! >= 0 ? chart.posToVal(chart.cursor.left!, "x") : null;
              this.read();
            },
          ],
        },
      },
      this.data(),
      this.host,
    );
    this.chart.over.append(this.now);
    this.version = "";
    this.header();
    this.update();
  }

  private scale(): uPlot.Scale {
    if (this.plot.log) return { distr: 3 };
    return { range: (_chart, low, high) => room(low, high, this.plot.limit?.(this.flights[0]!)) };
  }

  /** The limit. */
  private overlay({ ctx, bbox, valToPos }: uPlot): void {
    const limit = this.plot.limit?.(this.flights[0]!);
    const y = limit === undefined ? NaN : valToPos(limit, "y", true);
    if (!(y > bbox.top && y < bbox.top + bbox.height)) return;
    ctx.save();
    ctx.strokeStyle = theme.palette.warn;
    ctx.lineWidth = 1.4 * devicePixelRatio;
    ctx.setLineDash([5 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.restore();
  }

  private header(): void {
    const several = this.flights.length > 1;
    const named = this.lines.filter((line) => !line.quiet);
    this.values = named.map(() => el("b"));
    const keys = named.map((line, k) => {
      const swatch = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      swatch.setAttribute("viewBox", "0 0 22 6");
      swatch.setAttribute("class", "swatch");
      const stroke = document.createElementNS("http://www.w3.org/2000/svg", "line");
      for (const [name, value] of Object.entries({ x1: "0", y1: "3", x2: "22", y2: "3", stroke: line.colour, "stroke-width": "2", "stroke-dasharray": line.dash.join(" ") || "none" }))
        stroke.setAttribute(name, value);
      swatch.append(stroke);
      return el("span", { class: "key" }, swatch, el("span", {}, line.label), this.values[k]!);
    });
    this.head.replaceChildren(
      el("span", { class: "name" }, several ? this.plot.summaryTitle : this.plot.title, el("i", {}, ` ${this.plot.unit}`)),
      el("span", { class: "keys" }, ...keys),
    );
  }

  /** Values where the mouse is, else where the clock is. */
  private read(): void {
    const time = this.hovered ?? this.clock.time;
    this.values.forEach((cell, k) => {
      const line = this.lines[k]!;
      const flight = this.flights[this.flights.length > 1 ? k : 0]!;
      const value = flight.rows ? line.values(flight.rowAt(time + 1e-9)) : NaN;
      cell.textContent = format(value, this.plot.digits);
    });
    this.element.classList.toggle("hovered", this.hovered !== null);
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.host;
    if (clientWidth < 40 || clientHeight < 40) return;
    this.chart?.setSize({ width: clientWidth, height: clientHeight });
    this.update();
  }
}

/** All plots; `window` is the length of the past that live plots show, s. */
export function plots(flights: Flight[], clock: Clock, window = Infinity): Part {
  const rigid = flights.some((flight) => flight.info.body);
  const shown = PLOTS.filter(({ body }) => body === undefined || body === rigid);
  const charts = shown.map((plot) => new Chart(plot, flights, clock, window));
  const element = el("div", { class: "plots" }, ...charts.map((chart) => chart.element));
  return { element, update: () => charts.forEach((chart) => chart.update()) };
}

/** A number at an axis; none where the axis wants none. */
function short(value: number | null): string | null {
  if (value === null) return null;
  return Math.abs(value) >= 1000 ? `${value / 1000}k` : `${Number(value.toPrecision(6))}`;
}

const gap = (value: number): number | null => (Number.isFinite(value) ? value : null);

/** A range with room above and below that shows the limit. */
function room(low: number | null, high: number | null, limit?: number): [number, number] {
  let [from, to] = [low ?? 0, high ?? 1];
  if (limit !== undefined) [from, to] = [Math.min(from, limit), Math.max(to, limit)];
  const pad = 0.06 * (to - from) || 0.05 * Math.abs(to) || 1;
  return [from >= 0 && from < pad ? 0 : from - pad, to + pad];
}
