// The line to the server: it says hello, comes back by itself when lost, and hands on what it hears.

import type { Body, Mark } from "../data";
import type { Level } from "../tables";

export interface Knob {
  name: string;
  label: string;
  unit: string;
  min: number;
  max: number;
  value: number | null;
  log: boolean;
}

export interface Choice {
  name: string;
  label: string;
  options: string[];
  value: string | null;
}

export type Role = "steer" | "watch";

type Numbers = number | null | Numbers[];

export interface Hello {
  type: "hello";
  protocol: number;
  role: Role;
  name: string;
  n: number;
  cable_lengths: number[];
  radii: (number | null)[];
  body: Body | null;
  safe_angle_deg: number | null;
  safe_distance: number | null;
  /** Height of the ground, m, where there is one. */
  ground: number | null;
  /** What stands in the way: rows of eight numbers (colift.team.obstacles). */
  obstacles: number[][];
  knobs: Knob[];
  choices: Choice[];
}

export interface Rows {
  type: "rows";
  seq: number;
  time: number[];
  signals: Record<string, Numbers[]>;
}

export interface State {
  type: "state";
  paused: boolean;
  speed: number;
  lag: number;
  values: Record<string, number | string | null>;
  viewers: number;
  metrics: Record<string, number | null>;
  /** The verdict on the last seconds, once there is one. */
  level: Level | "";
  reasons: string[];
  saved: string | null;
}

export type Message =
  | Hello
  | Rows
  | State
  | { type: "role"; role: Role }
  | { type: "reset" }
  | { type: "events"; events: Mark[] }
  | { type: "refused"; reason: string };

export type Line = "connecting" | "open" | "lost";

export type Order =
  | { type: "set"; name: string; value: number }
  | { type: "choose"; name: string; value: string }
  | { type: "do"; action: "pause" | "resume" | "reset" | "save" }
  | { type: "do"; action: "push"; force: number[]; seconds: number }
  | { type: "do"; action: "cut"; drone: number }
  | { type: "do"; action: "target"; position: number[] }
  | { type: "do"; action: "steer"; velocity: number[] }
  | { type: "ack"; seq: number };

/** Waits between two attempts, ms. */
const FIRST_WAIT = 500;
const LONGEST_WAIT = 8000;

export class Connection {
  private socket: WebSocket | null = null;
  private wait = FIRST_WAIT;

  constructor(
    private readonly token: string | null,
    private readonly onMessage: (message: Message) => void,
    private readonly onLine: (line: Line) => void,
  ) {}

  open(): void {
    this.onLine("connecting");
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/live`);
    this.socket = socket;
    socket.addEventListener("open", () => {
      socket.send(JSON.stringify({ type: "hello", token: this.token }));
      this.onLine("open");
    });
    socket.addEventListener("message", (event) => {
      const message = JSON.parse(event.data as string) as Message;
      if (message.type === "hello") this.wait = FIRST_WAIT;
      this.onMessage(message);
    });
    socket.addEventListener("close", () => {
      this.onLine("lost");
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
    });
  }

  send(order: Order): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(order));
  }
}
