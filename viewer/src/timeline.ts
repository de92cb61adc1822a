// Transport: play, step, speed, and a track to scrub on that carries the events as marks.

import { SPEEDS, type Clock } from "./clock";
import type { Flight, Mark } from "./data";
import { button, el, icon, ICONS } from "./dom";
import { FOLLOWING, KINDS } from "./tables";

/** Width of a mark, and so the least distance of two, px. */
const MARK = 18;

/** A mark on the track: its place in percent, and how many others it stands for. */
export interface Placed {
  mark: Mark;
  place: number;
  others: number;
}

/** Causes of about the same time stand beside each other; what followed stands where there is room. */
export function arrange(events: Mark[], part: (time: number) => number, apart: number): Placed[] {
  const placed: Placed[] = [];
  let taken = -Infinity;
  for (const mark of events.filter(({ kind }) => !FOLLOWING.has(kind))) {
    taken = Math.min(Math.max(part(mark.time), taken + apart), 100);
    placed.push({ mark, place: taken, others: 0 });
  }
  for (const mark of events.filter(({ kind }) => FOLLOWING.has(kind))) {
    const place = part(mark.time);
    const near = placed.find((other) => Math.abs(other.place - place) < apart);
    if (near) near.others += 1;
    else placed.push({ mark, place, others: 0 });
  }
  return placed;
}

export class Timeline {
  readonly element: HTMLElement;
  private readonly toggle: HTMLButtonElement;
  private readonly readout = el("output", { class: "time", "aria-live": "off" });
  private readonly track = el("div", { class: "track", role: "slider", tabindex: "0", "aria-label": "Time" });
  private readonly played = el("div", { class: "played" });
  private readonly thumb = el("div", { class: "thumb" });
  private readonly marks = el("div", { class: "marks" });
  private readonly speed = el("select", { "aria-label": "Speed", title: "Speed ([ and ])" });
  private readonly edge: HTMLButtonElement;
  private drawn = "";

  constructor(
    private readonly clock: Clock,
    private readonly flights: Flight[],
  ) {
    this.toggle = button("Play", "Play or pause (space)", () => clock.play());
    for (const speed of SPEEDS) this.speed.append(el("option", { value: `${speed}` }, `${speed}\u00d7`));
    this.speed.addEventListener("change", () => clock.setSpeed(Number(this.speed.value)));
    this.track.append(el("div", { class: "rail" }), this.played, this.thumb);
    this.edge = button("Live", "To the present (End)", () => clock.seek(clock.end));
    this.edge.className = "edge";
    this.element = el(
      "section",
      { class: "timeline", "aria-label": "Time" },
      el(
        "div",
        { class: "transport" },
        button("Back", "One row back (left arrow)", () => this.step(-1), icon(ICONS.back)),
        this.toggle,
        button("Forward", "One row forward (right arrow)", () => this.step(1), icon(ICONS.forward)),
      ),
      el("div", { class: "scrub" }, this.marks, this.track),
      this.readout,
      this.speed,
      this.edge,
    );
    this.track.addEventListener("pointerdown", (down) => {
      this.track.setPointerCapture(down.pointerId);
      this.scrub(down);
    });
    this.track.addEventListener("pointermove", (move) => {
      if (this.track.hasPointerCapture(move.pointerId)) this.scrub(move);
    });
    clock.onChange(() => this.update());
    new ResizeObserver(() => this.drawMarks()).observe(this.track);
  }

  /** Move by rows of the first flight. */
  step(rows: number): void {
    const flight = this.flights[0]!;
    const row = flight.rowAt(this.clock.time + 1e-9);
    const inside = this.clock.time > flight.time.at(row) + 1e-9;
    const next = row + rows + (rows < 0 && inside ? 1 : 0);
    this.clock.play(false);
    this.clock.seek(flight.time.at(Math.min(Math.max(next, 0), flight.rows - 1)));
  }

  /** Jump to the next or last event. */
  jump(direction: 1 | -1): void {
    const times = this.flights.flatMap((flight) => flight.events.map((mark) => mark.time)).sort((a, b) => a - b);
    const { time } = this.clock;
    const there = direction > 0 ? times.find((t) => t > time + 1e-6) : times.findLast((t) => t < time - 1e-6);
    if (there !== undefined) this.clock.seek(there);
  }

  private scrub(event: PointerEvent): void {
    const { left, width } = this.track.getBoundingClientRect();
    this.clock.play(false);
    this.clock.seek(this.clock.start + ((event.clientX - left) / width) * (this.clock.end - this.clock.start));
  }

  private part(time: number): number {
    const { start, end } = this.clock;
    return end > start ? (100 * (time - start)) / (end - start) : 0;
  }

  private update(): void {
    const { clock } = this;
    const at = `${this.part(clock.time).toFixed(3)}%`;
    this.played.style.width = at;
    this.thumb.style.left = at;
    this.readout.textContent = `${clock.time.toFixed(2)} / ${clock.end.toFixed(2)} s`;
    this.toggle.replaceChildren(icon(clock.playing ? ICONS.pause : ICONS.play, 24, true));
    this.speed.value = `${clock.speed}`;
    this.edge.hidden = !clock.live;
    this.edge.setAttribute("aria-pressed", `${clock.following}`);
    for (const [name, value] of Object.entries({ min: clock.start, max: clock.end, now: clock.time }))
      this.track.setAttribute(`aria-value${name}`, value.toFixed(3));
    this.track.setAttribute("aria-valuetext", `${clock.time.toFixed(2)} seconds`);
    this.drawMarks();
  }

  private drawMarks(): void {
    const { start, end } = this.clock;
    const width = this.marks.clientWidth || 1;
    const state = `${width} ${start} ${end} ${this.flights.map((flight) => flight.events.length).join()}`;
    if (state === this.drawn) return;
    this.drawn = state;
    this.marks.replaceChildren();
    const apart = (100 * MARK) / width;
    this.flights.forEach((flight, lane) => {
      for (const { mark, place, others } of arrange(flight.events, (time) => this.part(time), apart)) {
        const made = this.mark(mark, flight, lane, place);
        if (others) made.title += ` (and ${others} more)`;
        this.marks.append(made);
      }
    });
    this.marks.style.height = `${18 * this.flights.length}px`;
  }

  private mark(mark: Mark, flight: Flight, lane: number, place: number): HTMLElement {
    const who = this.flights.length > 1 ? `${flight.info.label}: ` : "";
    const made = button(
      "",
      `${who}${mark.time.toFixed(2)} s, ${KINDS[mark.kind].word}: ${mark.text}`,
      () => this.clock.seek(mark.time),
      icon(KINDS[mark.kind].shape, 12),
    );
    made.className = `mark ${KINDS[mark.kind].tone}`;
    made.style.left = `${place.toFixed(3)}%`;
    made.style.top = `${18 * lane}px`;
    return made;
  }
}
