// The cockpit: header, one stage a flight, side panel, timeline; and the keys that drive them.

import { VIEWS, type View } from "./camera";
import { Clock } from "./clock";
import type { Flight, FlightInfo, Frame } from "./data";
import { button, el, format, icon, ICONS } from "./dom";
import { about, eventList, numbers, panel } from "./panel";
import { plots } from "./plots";
import type { Shown } from "./scene/element";
import { Stage } from "./scene/stage";
import { STATUS } from "./tables";
import { theme } from "./theme";
import { Timeline } from "./timeline";

const SWITCHES: [keyof Shown, string, string][] = [
  ["forces", "Forces", "f"],
  ["paths", "Paths", "p"],
  ["angles", "Angles", "a"],
  ["labels", "Labels", "l"],
  ["downwash", "Downwash", "w"],
];

const HELP: [string, string][] = [
  ["Space", "play or pause"],
  ["\u2190 \u2192", "one row back or forward; with Shift a second"],
  ["Home End", "start, end"],
  ["[ ]", "slower, faster"],
  [", .", "last moment, next moment"],
  ["1 2 3 4", "orbit, follow, top, side"],
  ["f p a l w", "forces, paths, angles, labels, downwash"],
  ["t", "dark or light"],
  ["?", "this list"],
];

export interface Options {
  bare?: boolean;
  camera?: string;
  /** Length of the past in the plots, s. */
  window?: number;
  /** A column of its own, and things at the right end of the header. */
  side?: HTMLElement;
  extras?: HTMLElement[];
  /** Keys that do something else than usual. */
  keys?: Record<string, () => void>;
}

/** The level in a word and the first reason; all of them on demand. */
function verdict({ level, reasons, summary }: FlightInfo): HTMLElement {
  const badge = el("b", { class: "badge" }, level);
  const [first, ...others] = reasons;
  if (first === undefined) return el("p", {}, badge, el("span", {}, summary));
  const more = others.length ? [el("small", {}, `+${others.length}`)] : [];
  const items = [...reasons, ...(summary ? [summary] : [])].map((reason) => el("li", {}, reason));
  return el("details", {}, el("summary", { title: "All reasons" }, badge, el("span", {}, first), ...more), el("ul", {}, ...items));
}

export class Cockpit {
  readonly clock = new Clock();
  readonly stages: Stage[];
  readonly timeline: Timeline;
  readonly shown: Shown = { forces: true, paths: true, angles: true, labels: true, downwash: false };
  view: View = "orbit";
  frames: Frame[] = [];
  private readonly hud: ((frame: Frame) => void)[] = [];
  private readonly chips = new Map<string, HTMLButtonElement>();
  private readonly help: HTMLDialogElement;
  private readonly verdicts: HTMLElement[];

  constructor(
    root: HTMLElement,
    readonly flights: Flight[],
    options: Options = {},
  ) {
    const { clock } = this;
    this.stages = flights.map((flight) => new Stage(flight, this.shown));
    this.timeline = new Timeline(clock, flights);
    this.verdicts = flights.map(() => el("div", { class: "verdict" }));
    this.judge();
    this.help = this.makeHelp();
    const charts = plots(flights, clock, options.window);
    const list = eventList(flights, clock);
    const table = numbers(flights);
    const tabs = [
      { name: "Plots", content: charts.element },
      { name: "Events", content: list.element },
      { name: "Numbers", content: table.element },
      ...(flights.some((flight) => flight.info.mission) ? [{ name: "Mission", content: about(flights) }] : []),
    ];
    const scenes = el("main", { class: "scenes" }, ...this.stages.map((stage, k) => this.scene(stage, flights[k]!)), this.toolbar());
    root.className = `cockpit${options.bare ? " bare" : ""}${options.side ? " flying" : ""}`;
    root.replaceChildren(
      this.header(options.extras ?? []),
      ...(options.side ? [options.side] : []),
      scenes,
      panel(tabs),
      this.timeline.element,
      this.help,
    );
    for (const stage of this.stages)
      stage.rig.onMove(() => {
        for (const other of this.stages) if (other !== stage) other.rig.match(stage.rig), other.draw();
      });
    clock.onChange(() => {
      if (flights.some((flight) => !flight.rows)) return;
      this.frames = flights.map((flight) => flight.sample(clock.time));
      this.frames.forEach((frame, k) => {
        this.stages[k]!.show(frame);
        this.hud[k]!(frame);
      });
      charts.update();
      list.update();
      table.update();
    });
    addEventListener("keydown", (event) => this.key(event, options.keys ?? {}));
    this.look((VIEWS as readonly string[]).includes(options.camera ?? "") ? (options.camera as View) : "orbit");
    this.refresh();
  }

  /** Take the range of the flights as the clock's. */
  refresh(): void {
    this.clock.span(
      Math.min(...this.flights.map((flight) => flight.start)),
      Math.max(...this.flights.map((flight) => flight.end)),
    );
  }

  /** Show the verdicts, where they have changed. */
  judge(): void {
    this.flights.forEach(({ info }, k) => {
      const box = this.verdicts[k]!;
      const said = [info.level, ...info.reasons, info.summary].join("\n");
      if (box.dataset.said === said) return;
      box.dataset.said = said;
      box.className = `verdict ${info.level}`;
      box.replaceChildren(...(info.level ? [verdict(info)] : []));
    });
  }

  look(view: View): void {
    this.view = view;
    for (const stage of this.stages) {
      stage.rig.set(view);
      stage.draw();
    }
    for (const name of VIEWS) this.chips.get(name)?.setAttribute("aria-pressed", `${name === view}`);
  }

  flip(name: keyof Shown): void {
    this.shown[name] = !this.shown[name];
    this.chips.get(name)?.setAttribute("aria-pressed", `${this.shown[name]}`);
    for (const stage of this.stages) stage.draw();
  }

  private header(extras: HTMLElement[]): HTMLElement {
    const names = [...new Set(this.flights.map((flight) => flight.info.name))].join(" | ");
    return el(
      "header",
      {},
      el("strong", { class: "brand" }, "colift"),
      el("h1", {}, names),
      ...(this.flights.length === 1 ? [this.verdicts[0]!] : []),
      el("span", { class: "space" }),
      ...extras,
      button("Theme", "Dark or light (t)", () => theme.toggle(), icon(ICONS.sun)),
      button("Keys", "Keyboard (?)", () => this.help.showModal(), icon(ICONS.help)),
    );
  }

  private toolbar(): HTMLElement {
    const chip = (name: string, title: string, action: () => void, pressed: boolean): HTMLButtonElement => {
      const made = button(title, title, action);
      made.setAttribute("aria-pressed", `${pressed}`);
      this.chips.set(name, made);
      return made;
    };
    const views = VIEWS.map((view) => chip(view, view[0]!.toUpperCase() + view.slice(1), () => this.look(view), view === this.view));
    const rigid = this.flights.some((flight) => flight.info.body);
    const switches = SWITCHES.map(([name, title]) =>
      chip(name, rigid && name === "angles" ? "Distances" : title, () => this.flip(name), this.shown[name]),
    );
    return el(
      "div",
      { class: "toolbar" },
      el("div", { class: "group", role: "group", "aria-label": "Camera" }, ...views),
      el("div", { class: "group", role: "group", "aria-label": "Show" }, ...switches),
    );
  }

  private scene(stage: Stage, flight: Flight): HTMLElement {
    const rigid = flight.info.body !== null;
    const closest = rigid ? "closest drones" : "smallest angle";
    const cells = ["error", closest, "total tension", "allocator"].map((name) => ({ name, out: el("b") }));
    const [error, near, total, status] = cells.map((cell) => cell.out);
    this.hud.push((frame) => {
      const [turned, angle, apart] = [frame.turned[0]!, frame.angle[0]!, frame.apart[0]!];
      error!.textContent = `${format(100 * frame.error[0]!)} cm${rigid ? `, ${format(turned)}\u00b0` : ""}`;
      near!.textContent = rigid ? `${format(apart)} m` : `${format(angle, 1)}\u00b0`;
      const least = (rigid ? flight.info.safe_distance : flight.info.safe_angle_deg) ?? 0;
      near!.classList.toggle("low", (rigid ? apart : angle) < least);
      const sum = frame.tensions.reduce((so, tension) => so + (Number.isFinite(tension) ? tension : 0), 0);
      total!.textContent = frame.tensions.some(Number.isFinite) ? `${sum.toFixed(2)} N` : "\u2013";
      status!.textContent = STATUS[frame.status[0]!] ?? "\u2013";
    });
    const several = this.flights.length > 1;
    const title = several ? [el("div", { class: "title" }, el("b", {}, flight.info.label), this.verdicts[this.flights.indexOf(flight)]!)] : [];
    const full = `${Number(flight.full.toPrecision(2))} N or more`;
    const scale = el("div", {}, el("dt", {}, "cables"), el("dd", { class: "tension-scale" }, "slack", el("i"), full));
    return el(
      "section",
      { class: "scene", "aria-label": flight.info.label },
      stage.element,
      el(
        "div",
        { class: "overlay" },
        ...title,
        el("dl", { class: "hud" }, ...cells.map((cell) => el("div", {}, el("dt", {}, cell.name), el("dd", {}, cell.out))), scale),
      ),
    );
  }

  private makeHelp(): HTMLDialogElement {
    const rows = HELP.map(([keys, text]) => el("tr", {}, el("th", {}, keys), el("td", {}, text)));
    const dialog = el("dialog", {}, el("h2", {}, "Keyboard"), el("table", {}, ...rows));
    dialog.append(button("Close", "Close", () => dialog.close()));
    return dialog;
  }

  private key(event: KeyboardEvent, others: Record<string, () => void>): void {
    const target = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(target.tagName)) return;
    const { clock } = this;
    const actions: Record<string, () => void> = {
      " ": () => clock.play(),
      ArrowLeft: () => (event.shiftKey ? clock.seek(clock.time - 1) : this.timeline.step(-1)),
      ArrowRight: () => (event.shiftKey ? clock.seek(clock.time + 1) : this.timeline.step(1)),
      Home: () => clock.seek(clock.start),
      End: () => clock.seek(clock.end),
      "[": () => clock.faster(-1),
      "]": () => clock.faster(1),
      ",": () => this.timeline.jump(-1),
      ".": () => this.timeline.jump(1),
      t: () => theme.toggle(),
      "?": () => this.help.showModal(),
    };
    VIEWS.forEach((view, k) => (actions[`${k + 1}`] = () => this.look(view)));
    for (const [name, , key] of SWITCHES) actions[key] = () => this.flip(name);
    const action = others[event.key] ?? actions[event.key];
    if (!action || event.defaultPrevented || this.help.open) return;
    event.preventDefault();
    action();
  }
}
