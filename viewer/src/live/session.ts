// A flight under way: what the server says goes into the flight, what the pilot does goes to the server.

import { Flight, type FlightInfo } from "../data";
import { el } from "../dom";
import { Cockpit } from "../layout";
import { Connection, type Hello, type Line, type Message, type Role, type State } from "./connection";
import { Controls } from "./controls";
import { append } from "./rows";
import { Steer } from "./steer";

/** Length of the past in the plots, s. */
const WINDOW = 30;
/** How long a refusal stays on the screen, ms. */
const TOAST = 5000;

const GRAVITY = 9.81;

const WORDS: Record<Line, string> = { connecting: "connecting", open: "live", lost: "connection lost" };

export class Session {
  cockpit: Cockpit | null = null;
  private flight: Flight | null = null;
  private controls: Controls | null = null;
  private steer: Steer | null = null;
  private hello: Hello | null = null;
  private readonly line = el("span", { class: "line", role: "status" });
  private readonly role = el("span", { class: "role" });
  private readonly facts = el("span", { class: "facts" });
  private readonly toast = el("div", { class: "toast", role: "alert", hidden: "" });
  private readonly connection: Connection;
  private pending = 0;
  private seq: number | null = null;

  constructor(
    private readonly root: HTMLElement,
    private readonly ready: (cockpit: Cockpit) => void,
  ) {
    const token = location.hash.slice(1) || null;
    this.connection = new Connection(
      token,
      (message) => this.hear(message),
      (line) => this.show(line),
    );
    root.className = "waiting";
    root.replaceChildren(this.line);
    document.body.append(this.toast);
    this.connection.open();
  }

  private hear(message: Message): void {
    switch (message.type) {
      case "hello":
        return this.greet(message);
      case "role":
        return this.take(message.role);
      case "reset":
        this.flight?.clear();
        if (this.cockpit) this.cockpit.clock.following = true;
        return undefined;
      case "rows":
        if (!this.flight) return undefined;
        append(this.flight, message);
        this.seq = message.seq;
        return this.later();
      case "events":
        for (const event of message.events) {
          const known = this.flight?.events.some((mark) => mark.time === event.time && mark.text === event.text);
          if (!known) this.flight?.events.push(event);
        }
        return this.later();
      case "state":
        return this.state(message);
      case "refused":
        return this.say(message.reason);
    }
  }

  private greet(hello: Hello): void {
    const before = this.hello;
    this.hello = hello;
    if (!before) this.flight = new Flight(about(hello));
    else if (before.n === hello.n && before.name === hello.name) this.flight?.clear();
    else location.reload(); // another flight has taken the place
    this.take(hello.role);
  }

  private take(role: Role): void {
    this.hello!.role = role;
    this.role.textContent = role === "steer" ? "you steer" : "watching";
    this.controls?.role(role);
    if (this.steer) this.steer.active = role === "steer";
  }

  /** Draw once a picture, however many messages there were, and only then tell the server to go on. */
  private later(): void {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => {
      this.pending = 0;
      const { flight } = this;
      if (!flight?.rows) return;
      if (!this.cockpit) this.build(flight);
      this.cockpit!.refresh();
      this.controls!.gone(Array.from({ length: flight.n }, (_, i) => Number.isNaN(flight.columns.tensions.at(flight.rows - 1, i))));
      if (this.seq !== null) this.connection.send({ type: "ack", seq: this.seq });
      this.seq = null;
    });
  }

  private build(flight: Flight): void {
    const hello = this.hello!;
    const thrusts = Array.from({ length: flight.n }, (_, i) => flight.columns.thrusts.at(0, i)).filter(Number.isFinite);
    flight.info.thrust = thrusts.reduce((sum, thrust) => sum + thrust, 0) / thrusts.length || 1;
    this.controls = new Controls(
      hello,
      (order) => this.connection.send(order),
      (on) => this.steer && (this.steer.targeting = on),
    );
    this.cockpit = new Cockpit(this.root, [flight], {
      camera: "follow",
      window: WINDOW,
      side: this.controls.element,
      extras: [this.facts, this.role, this.line],
      keys: { " ": () => this.controls!.togglePause() },
    });
    this.cockpit.clock.live = this.cockpit.clock.following = true;
    this.steer = new Steer(this.cockpit.stages[0]!, flight, (order) => this.connection.send(order));
    this.take(hello.role);
    this.ready(this.cockpit);
  }

  private state(state: State): void {
    this.controls?.state(state);
    const lag = state.lag > 0.1 ? `, ${state.lag.toFixed(1)} s behind` : "";
    const viewers = `${state.viewers} page${state.viewers === 1 ? "" : "s"}`;
    this.facts.textContent = `${state.paused ? "paused" : `${state.speed}\u00d7`}${lag}, ${viewers}`;
    if (!this.flight) return;
    this.flight.info.metrics = Object.entries(state.metrics).map(([name, value]) => ({
      name,
      meaning: name.replaceAll("_", " "),
      unit: "",
      value,
    }));
    Object.assign(this.flight.info, { level: state.level, reasons: state.reasons });
    this.cockpit?.judge();
  }

  private show(line: Line): void {
    this.line.textContent = WORDS[line];
    this.line.dataset.line = line;
  }

  private say(text: string): void {
    this.toast.textContent = text;
    this.toast.hidden = false;
    setTimeout(() => (this.toast.hidden = true), TOAST);
  }
}

function about(hello: Hello): FlightInfo {
  const mass = hello.knobs.find((knob) => knob.name === "load.mass")?.value ?? 0.1 * hello.n;
  return {
    name: hello.name,
    label: hello.name,
    description: "",
    level: "",
    reasons: [],
    summary: "",
    n: hello.n,
    cable_lengths: hello.cable_lengths,
    radii: hello.radii,
    body: hello.body,
    safe_angle_deg: hello.safe_angle_deg,
    safe_distance: hello.safe_distance,
    ground: hello.ground,
    obstacles: hello.obstacles,
    weight: mass * GRAVITY,
    thrust: 1,
    facts: {},
    metrics: [],
    mission: "",
  };
}
