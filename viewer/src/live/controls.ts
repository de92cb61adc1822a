// Everything that can be turned and pressed in flight. Who only watches sees it, but cannot use it.

import { button, el, format } from "../dom";
import type { Hello, Knob, Order, Role, State } from "./connection";

/** After a change by hand, what the server says about that knob is not shown for so long, ms. */
const QUIET = 800;
/** Least time between two messages of one knob, ms. */
const PACE = 60;

interface Dial {
  show: (value: number) => void;
}

export class Controls {
  readonly element = el("aside", { class: "controls", "aria-label": "Fly" });
  private readonly dials = new Map<string, Dial>();
  private readonly selects = new Map<string, HTMLSelectElement>();
  private readonly fields = el("fieldset");
  private readonly pause: HTMLButtonElement;
  private readonly note = el("p", { class: "note" });
  private readonly target: HTMLButtonElement;
  private readonly cuts: HTMLButtonElement[];
  private paused = false;

  constructor(
    hello: Hello,
    private readonly send: (order: Order) => void,
    onTarget: (on: boolean) => void,
  ) {
    this.pause = button("Pause", "Pause or go on (space)", () => this.togglePause());
    this.target = button("Drag target", "Drag the load's target in the scene; with Shift up and down", () => {
      const on = this.target.getAttribute("aria-pressed") !== "true";
      this.target.setAttribute("aria-pressed", `${on}`);
      onTarget(on);
    });
    this.target.setAttribute("aria-pressed", "false");
    this.cuts = Array.from({ length: hello.n }, (_, drone) =>
      button(`${drone}`, `Cut cable ${drone}`, () => send({ type: "do", action: "cut", drone })),
    );
    const act = (label: string, title: string, action: "reset" | "save"): HTMLButtonElement =>
      button(label, title, () => send({ type: "do", action }));
    this.fields.append(
      el(
        "div",
        { class: "buttons" },
        this.pause,
        act("Reset", "Start the flight again", "reset"),
        act("Save", "Save the recording", "save"),
        this.target,
      ),
      ...this.choices(hello),
      ...hello.knobs.map((knob) => this.knob(knob)),
      this.push(),
      el("div", { class: "row" }, el("span", {}, "Cut cable"), el("div", { class: "cuts" }, ...this.cuts)),
    );
    this.element.append(this.fields, this.note);
    this.role(hello.role);
  }

  role(role: Role): void {
    this.fields.disabled = role !== "steer";
    this.note.textContent =
      role === "steer" ? "Arrow keys and Page Up, Page Down steer; so does a gamepad." : "You are watching; somebody else steers.";
  }

  togglePause(): void {
    if (this.fields.disabled) return;
    this.send({ type: "do", action: this.paused ? "resume" : "pause" });
  }

  state(state: State): void {
    this.paused = state.paused;
    this.pause.textContent = state.paused ? "Go on" : "Pause";
    for (const [name, value] of Object.entries(state.values)) {
      if (typeof value === "number") this.dials.get(name)?.show(value);
      const select = this.selects.get(name);
      if (select && typeof value === "string" && document.activeElement !== select) select.value = value;
    }
    if (state.saved) this.note.textContent = `Saved as ${state.saved}`;
  }

  /** Cables that are cut cannot be cut again. */
  gone(drones: boolean[]): void {
    drones.forEach((gone, i) => (this.cuts[i]!.disabled = gone));
  }

  private choices(hello: Hello): HTMLElement[] {
    return hello.choices.map((choice) => {
      const select = el("select", { "aria-label": choice.label, "data-name": choice.name });
      for (const option of choice.options) select.append(el("option", { value: option }, option));
      if (choice.value !== null) select.value = choice.value;
      select.addEventListener("change", () => {
        this.send({ type: "choose", name: choice.name, value: select.value });
        select.blur();
      });
      this.selects.set(choice.name, select);
      return el("label", { class: "row" }, el("span", {}, choice.label), select);
    });
  }

  private knob(knob: Knob): HTMLElement {
    const { dial, element } = slider(knob.label, knob.unit, knob.min, knob.max, knob.log, knob.name, (value) =>
      this.send({ type: "set", name: knob.name, value }),
    );
    if (knob.value !== null) dial.show(knob.value);
    this.dials.set(knob.name, dial);
    return element;
  }

  private push(): HTMLElement {
    let strength = 1;
    let heading = 0;
    const strong = slider("Push", "N", 0.1, 10, true, "push", (value) => (strength = value));
    const towards = slider("towards", "\u00b0", -180, 180, false, "heading", (value) => (heading = value));
    strong.dial.show(strength);
    towards.dial.show(heading);
    const go = button("Push the load", "Push the load for half a second", () => {
      const angle = (heading * Math.PI) / 180;
      const force = [strength * Math.cos(angle), strength * Math.sin(angle), 0];
      this.send({ type: "do", action: "push", force, seconds: 0.5 });
    });
    return el("div", { class: "push" }, strong.element, towards.element, el("div", { class: "buttons" }, go));
  }
}

/** A slider with its value written; in powers of ten where `log`. */
function slider(
  label: string,
  unit: string,
  min: number,
  max: number,
  log: boolean,
  name: string,
  turned: (value: number) => void,
): { dial: Dial; element: HTMLElement } {
  const low = log ? Math.log(min) : min;
  const high = log ? Math.log(max) : max;
  const input = el("input", {
    type: "range",
    min: `${low}`,
    max: `${high}`,
    step: `${(high - low) / 400}`,
    "data-name": name,
    "aria-label": label,
  });
  const out = el("output");
  const write = (value: number): void => {
    const digits = value === 0 ? 0 : Math.min(Math.max(2 - Math.floor(Math.log10(Math.abs(value))), 0), 4);
    out.textContent = `${format(value, digits)} ${unit}`;
    input.setAttribute("aria-valuetext", out.textContent);
  };
  let touched = -Infinity;
  let timer = 0;
  input.addEventListener("input", () => {
    touched = performance.now();
    const read = (): number => (log ? Math.exp(Number(input.value)) : Number(input.value));
    write(read());
    timer ||= window.setTimeout(() => {
      timer = 0;
      turned(read());
    }, PACE);
  });
  const show = (value: number): void => {
    if (performance.now() - touched < QUIET) return;
    input.value = `${log ? Math.log(Math.max(value, min)) : value}`;
    write(value);
  };
  return { dial: { show }, element: el("label", { class: "knob" }, el("span", {}, label), out, input) };
}
