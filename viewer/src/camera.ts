// Views: orbit freely, follow the load, look from the top or the side. Views of several flights move as one.

import { Box3, MOUSE, type PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export const VIEWS = ["orbit", "follow", "top", "side"] as const;
export type View = (typeof VIEWS)[number];

const TOWARDS: Record<View, [number, number, number]> = {
  orbit: [0.75, -1, 0.55],
  follow: [0.75, -1, 0.45],
  top: [0, -0.001, 1],
  side: [0, -1, 0.03],
};

/** Part of the window that a fitted flight fills. */
const FILL = 0.92;

export class Rig {
  view: View = "orbit";
  private readonly controls: OrbitControls;
  private readonly centre = new Vector3();
  private readonly load = new Vector3();
  private readonly listeners: (() => void)[] = [];

  constructor(
    readonly camera: PerspectiveCamera,
    canvas: HTMLCanvasElement,
    private readonly points: Vector3[],
    private readonly margin: number,
    private readonly cable: number,
  ) {
    this.controls = new OrbitControls(camera, canvas);
    this.controls.enableDamping = false;
    this.controls.mouseButtons = { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    this.controls.minDistance = 0.3;
    this.controls.maxDistance = 60;
    new Box3().setFromPoints(points).getCenter(this.centre);
    this.load.copy(this.centre);
    this.controls.addEventListener("change", () => this.listeners.forEach((listener) => listener()));
    this.set("orbit");
  }

  onMove(listener: () => void): void {
    this.listeners.push(listener);
  }

  set enabled(on: boolean) {
    this.controls.enabled = on;
  }

  /** Angle about the vertical by which the camera is turned from looking along y, rad. */
  get heading(): number {
    const away = this.controls.target.clone().sub(this.camera.position);
    return Math.atan2(-away.x, away.y);
  }

  set(view: View): void {
    this.view = view;
    const follows = view === "follow";
    // A followed formation stands above its load.
    const target = (follows ? this.load : this.centre).clone();
    if (follows) target.z += 0.5 * this.cable;
    this.controls.target.copy(target);
    this.camera.position.set(...TOWARDS[view]).normalize().add(target);
    this.camera.lookAt(target);
    this.camera.position.sub(target).setLength(follows ? this.near() : this.fit()).add(target);
    this.controls.update();
  }

  /** Distance at which the formation is seen with its arrows. */
  private near(): number {
    const half = (this.camera.fov * Math.PI) / 360;
    return (this.cable + this.margin) / Math.sin(Math.min(half, Math.atan(Math.tan(half) * this.camera.aspect)));
  }

  /** Distance from the centre at which the whole flight is seen, the way the camera looks now. */
  private fit(): number {
    const up = Math.tan((this.camera.fov * Math.PI) / 360) * FILL;
    const back = this.camera.quaternion.clone().invert();
    const seen = new Vector3();
    let distance = 1;
    for (const point of this.points) {
      seen.copy(point).sub(this.centre).applyQuaternion(back);
      const wide = Math.max((Math.abs(seen.x) + this.margin) / (up * this.camera.aspect), (Math.abs(seen.y) + this.margin) / up);
      distance = Math.max(distance, wide + seen.z);
    }
    return distance;
  }

  follow(load: ArrayLike<number>): void {
    const [x, y, z] = [load[0]!, load[1]!, load[2]!];
    if (!Number.isFinite(x + y + z)) return;
    const before = this.load.clone();
    this.load.set(x, y, z);
    if (this.view !== "follow") return;
    const moved = before.negate().add(this.load);
    this.controls.target.add(moved);
    this.camera.position.add(moved);
    this.controls.update();
  }

  resize(aspect: number): void {
    const first = this.camera.aspect === 1 || aspect < 1 !== this.camera.aspect < 1;
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    if (first) this.set(this.view);
  }

  /** Look as another one looks; each keeps its own load when following. */
  match(other: Rig): void {
    this.view = other.view;
    const follows = this.view === "follow";
    const offset = follows ? this.load.clone().sub(other.load) : new Vector3();
    this.controls.target.copy(other.controls.target).add(offset);
    this.camera.position.copy(other.camera.position).add(offset);
    this.camera.lookAt(this.controls.target);
  }
}
