// Text over the scene: a pool of elements moved to where their points appear.

import type { Camera, Vector3 } from "three";
import { el } from "../dom";
import type { Labels } from "./element";

export class Overlay implements Labels {
  readonly element = el("div", { class: "labels", "aria-hidden": "true" });
  private readonly pool: HTMLElement[] = [];
  private used = 0;
  private width = 1;
  private height = 1;

  constructor(private readonly camera: Camera) {}

  begin(width: number, height: number): void {
    this.used = 0;
    this.width = width;
    this.height = height;
  }

  put(text: string, at: Vector3, kind: string): void {
    const seen = at.clone().project(this.camera);
    if (seen.z > 1 || Math.abs(seen.x) > 1.1 || Math.abs(seen.y) > 1.1) return;
    let label = this.pool[this.used];
    if (!label) {
      label = el("span");
      this.pool.push(label);
      this.element.append(label);
    }
    this.used += 1;
    label.hidden = false;
    label.className = `label ${kind}`;
    if (label.textContent !== text) label.textContent = text;
    const x = ((seen.x + 1) / 2) * this.width;
    const y = ((1 - seen.y) / 2) * this.height;
    label.style.transform = `translate(-50%, -50%) translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
  }

  end(): void {
    for (const label of this.pool.slice(this.used)) label.hidden = true;
  }
}
