// One flight in 3D. To add a thing to the scene, write its file and name it in MAKERS.

import { Box3, Color, DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { Rig } from "../camera";
import type { Flight, Frame } from "../data";
import { el } from "../dom";
import { theme } from "../theme";
import { angles } from "./angles";
import { cables } from "./cables";
import { downwash } from "./downwash";
import { drones } from "./drones";
import type { Element, Maker, Shown } from "./element";
import { forces } from "./forces";
import { ground } from "./ground";
import { Overlay } from "./labels";
import { load } from "./load";
import { nearest } from "./nearest";
import { obstacles } from "./obstacles";
import { paths } from "./paths";
import { target } from "./target";

const MAKERS: Maker[] = [ground, obstacles, paths, load, cables, drones, forces, angles, nearest, downwash, target];

export class Stage {
  readonly element = el("div", { class: "stage" });
  readonly rig: Rig;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly overlay: Overlay;
  private readonly elements: Element[];
  private frame: Frame | null = null;
  private sized = false;

  constructor(
    flight: Flight,
    private readonly shown: Shown,
  ) {
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.domElement.setAttribute("aria-label", `3D view of ${flight.info.name}`);
    const camera = new PerspectiveCamera(38, 1, 0.05, 400);
    camera.up.set(0, 0, 1);
    const lengths = flight.info.cable_lengths;
    const mean = lengths.reduce((sum, length) => sum + length, 0) / lengths.length;
    const points = places(flight);
    const box = new Box3().setFromPoints(points);
    const scale = {
      drone: 0.17 * mean,
      floor: flight.info.ground ?? Math.min(0, Math.floor(box.min.z + 0.3)),
      centre: box.getCenter(new Vector3()),
      radius: Math.max(2, 0.5 * box.getSize(new Vector3()).length()),
    };
    this.rig = new Rig(camera, this.renderer.domElement, points, 2.2 * scale.drone, mean);
    this.overlay = new Overlay(camera);
    this.element.append(this.renderer.domElement, this.overlay.element);
    this.elements = MAKERS.map((make) => make(flight, scale));
    const sun = new DirectionalLight("#ffffff", 2.1);
    sun.position.set(3, -4, 8);
    const sky = new HemisphereLight("#ffffff", "#6b7480", 1.5);
    this.scene.add(sun, sky, ...this.elements.map((element) => element.object));

    theme.onChange((palette) => {
      this.scene.background = new Color(palette.back);
      for (const element of this.elements) element.paint(palette);
      this.draw();
    });
    this.rig.onMove(() => this.draw());
    new ResizeObserver(() => this.resize()).observe(this.element);
  }

  show(frame: Frame): void {
    this.frame = frame;
    this.rig.follow(frame.load);
    this.draw();
  }

  /** Draw the frame again: something else than the time has changed. */
  draw(): void {
    if (!this.frame) return;
    const { clientWidth, clientHeight } = this.element;
    this.overlay.begin(clientWidth, clientHeight);
    this.rig.camera.updateMatrixWorld();
    for (const element of this.elements) element.update(this.frame, this.shown, this.overlay);
    this.overlay.end();
    this.renderer.render(this.scene, this.rig.camera);
    if (this.sized) this.element.dataset.drawn = "";
  }

  /** Where a point of the window meets the level plane at a height, in the world; for dragging. */
  pick(x: number, y: number, height: number): Vector3 | null {
    const area = this.element.getBoundingClientRect();
    const point = new Vector3(((x - area.left) / area.width) * 2 - 1, 1 - ((y - area.top) / area.height) * 2, 0.5);
    const { camera } = this.rig;
    const ray = point.unproject(camera).sub(camera.position).normalize();
    const distance = (height - camera.position.z) / ray.z;
    return distance > 0 && distance < 100 ? ray.multiplyScalar(distance).add(camera.position) : null;
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.element;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight);
    this.rig.resize(clientWidth / clientHeight);
    this.sized = true;
    this.draw();
  }
}

/** Where things are in the course of the flight, thinned. */
function places(flight: Flight): Vector3[] {
  const points: Vector3[] = [];
  for (const column of [flight.columns.load, flight.columns.reference, flight.columns.positions]) {
    for (let row = 0; row < flight.rows; row += Math.ceil(flight.rows / 150)) {
      for (let k = 0; k < column.width; k += 3) {
        const point = new Vector3(column.at(row, k), column.at(row, k + 1), column.at(row, k + 2));
        if (point.length() < 1e3) points.push(point);
      }
    }
  }
  return points.length ? points : [new Vector3(-1.5, -1.5, 0), new Vector3(1.5, 1.5, 2.5)];
}
