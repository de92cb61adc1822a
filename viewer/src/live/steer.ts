// Steering: held keys or a gamepad give the wanted velocity of the load, as seen from the camera; a drag a target.

import { Vector3 } from "three";
import type { Flight } from "../data";
import type { Stage } from "../scene/stage";
import type { Order } from "./connection";

/** Speed at full deflection, m/s. */
const SPEED = 1;
/** Time between two messages, ms: well within the half second after which the server stops the load. */
const PACE = 100;
/** Deflection of a stick that counts as none. */
const DEAD = 0.15;

const KEYS: Record<string, [number, number, number]> = {
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  ArrowLeft: [-1, 0, 0],
  ArrowRight: [1, 0, 0],
  PageUp: [0, 0, 1],
  PageDown: [0, 0, -1],
};

export class Steer {
  active = false;
  private readonly held = new Set<string>();
  private moving = false;
  private dragging = false;

  constructor(
    private readonly stage: Stage,
    private readonly flight: Flight,
    private readonly send: (order: Order) => void,
  ) {
    addEventListener("keydown", (event) => {
      const typing = /^(INPUT|SELECT|TEXTAREA)$/.test((event.target as HTMLElement).tagName);
      if (!(event.key in KEYS) || typing || !this.active) return;
      event.preventDefault();
      this.held.add(event.key);
    }, true);
    addEventListener("keyup", (event) => this.held.delete(event.key));
    addEventListener("blur", () => this.held.clear());
    setInterval(() => this.beat(), PACE);
    this.drag();
  }

  /** Whether a drag in the scene moves the target instead of the camera. */
  set targeting(on: boolean) {
    this.dragging = on;
    this.stage.rig.enabled = !on;
    this.flight.target = on ? this.here() : null;
    this.stage.draw();
  }

  private beat(): void {
    if (!this.active) return;
    const wanted = new Vector3();
    for (const key of this.held) wanted.add(new Vector3(...KEYS[key]!));
    for (const pad of navigator.getGamepads()) {
      const [x = 0, y = 0, , z = 0] = pad?.axes ?? [];
      wanted.add(new Vector3(...[x, -y, -z].map((part) => (Math.abs(part) > DEAD ? part : 0)) as [number, number, number]));
    }
    const moving = wanted.lengthSq() > 0;
    if (!moving && !this.moving) return;
    this.moving = moving;
    wanted.clampLength(0, 1).multiplyScalar(SPEED).applyAxisAngle(UP, this.stage.rig.heading);
    this.send({ type: "do", action: "steer", velocity: wanted.toArray() });
  }

  private here(): [number, number, number] {
    const { reference } = this.flight.columns;
    const row = this.flight.rows - 1;
    return [reference.at(row, 0), reference.at(row, 1), reference.at(row, 2)];
  }

  private drag(): void {
    const area = this.stage.element;
    let last = 0;
    area.addEventListener("pointerdown", (event) => {
      if (!this.dragging || !this.active || event.button !== 0) return;
      area.setPointerCapture(event.pointerId);
      last = event.clientY;
      move(event);
    });
    const move = (event: PointerEvent): void => {
      const target = this.flight.target ?? this.here();
      if (event.shiftKey) target[2] = Math.max(0, target[2] + 0.01 * (last - event.clientY));
      else {
        const point = this.stage.pick(event.clientX, event.clientY, target[2]);
        if (point) target.splice(0, 2, point.x, point.y);
      }
      last = event.clientY;
      this.flight.target = target;
      this.stage.draw();
    };
    area.addEventListener("pointermove", (event) => {
      if (area.hasPointerCapture(event.pointerId)) move(event);
    });
    area.addEventListener("pointerup", (event) => {
      if (!area.hasPointerCapture(event.pointerId) || !this.flight.target) return;
      area.releasePointerCapture(event.pointerId);
      this.send({ type: "do", action: "target", position: [...this.flight.target] });
    });
  }
}

const UP = new Vector3(0, 0, 1);
