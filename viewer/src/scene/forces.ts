// Arrows: the wanted force and a disturbance on the load, and the thrust of each drone.

import { ConeGeometry, CylinderGeometry, Group, InstancedMesh, Matrix4, MeshBasicMaterial, Quaternion, Vector3 } from "three";
import type { Frame } from "../data";
import type { Maker } from "./element";

const UP = new Vector3(0, 0, 1);
const NONE = new Matrix4().makeScale(0, 0, 0);

/** Longest arrow, in lengths of a cable: a spike must not hide the flight. */
const LONGEST = 1.2;

/** Arrows of one colour. */
class Arrows {
  readonly object = new Group();
  readonly material = new MeshBasicMaterial();
  private readonly shafts: InstancedMesh;
  private readonly heads: InstancedMesh;
  private readonly matrix = new Matrix4();
  private readonly turn = new Quaternion();
  private readonly size = new Vector3();
  private readonly tip = new Vector3();

  constructor(
    count: number,
    private readonly radius: number,
    private readonly longest: number,
  ) {
    const shaft = new CylinderGeometry(1, 1, 1, 8).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    const head = new ConeGeometry(1, 1, 12).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    this.shafts = new InstancedMesh(shaft, this.material, count);
    this.heads = new InstancedMesh(head, this.material, count);
    for (const mesh of [this.shafts, this.heads]) {
      mesh.frustumCulled = false;
      this.object.add(mesh);
    }
  }

  set(i: number, from: Vector3, vector: Vector3): void {
    const length = vector.clampLength(0, this.longest).length();
    const shown = Number.isFinite(length + from.x) && length > 4 * this.radius;
    if (shown) {
      const head = Math.min(5 * this.radius, 0.5 * length);
      this.turn.setFromUnitVectors(UP, this.tip.copy(vector).divideScalar(length));
      this.matrix.compose(from, this.turn, this.size.set(this.radius, this.radius, length - head));
      this.shafts.setMatrixAt(i, this.matrix);
      this.tip.multiplyScalar(length - head).add(from);
      this.matrix.compose(this.tip, this.turn, this.size.set(2.4 * this.radius, 2.4 * this.radius, head));
      this.heads.setMatrixAt(i, this.matrix);
    } else {
      this.shafts.setMatrixAt(i, NONE);
      this.heads.setMatrixAt(i, NONE);
    }
    this.shafts.instanceMatrix.needsUpdate = this.heads.instanceMatrix.needsUpdate = true;
  }
}

export const forces: Maker = (flight, { drone }) => {
  const object = new Group();
  const radius = 0.05 * drone;
  const cable = flight.info.cable_lengths[0]!;
  const wanted = new Arrows(1, 1.3 * radius, LONGEST * cable);
  const pushed = new Arrows(1, 1.3 * radius, LONGEST * cable);
  const thrusts = new Arrows(flight.n, radius, LONGEST * cable);
  object.add(wanted.object, pushed.object, thrusts.object);

  const from = new Vector3();
  const vector = new Vector3();
  const attitude = new Quaternion();
  const on = (arrows: Arrows, force: Float32Array, frame: Frame, unit: number): void =>
    arrows.set(0, from.fromArray(frame.load), vector.fromArray(force).multiplyScalar(unit));
  return {
    object,
    paint(palette) {
      wanted.material.color.set(palette.force);
      pushed.material.color.set(palette.external);
      thrusts.material.color.set(palette.thrust);
    },
    update(frame, shown) {
      object.visible = shown.forces;
      if (!shown.forces) return;
      const unit = (0.5 * cable) / Math.max(flight.info.weight, 1e-6);
      on(wanted, frame.force, frame, unit);
      on(pushed, frame.external, frame, unit);
      for (let i = 0; i < frame.n; i++) {
        const [w, x, y, z] = frame.attitudes.subarray(4 * i, 4 * i + 4);
        attitude.set(x!, y!, z!, w!);
        const thrust = (0.45 * cable * frame.thrusts[i]!) / Math.max(flight.info.thrust, 1e-6);
        thrusts.set(i, from.fromArray(frame.positions, 3 * i), vector.set(0, 0, thrust).applyQuaternion(attitude));
      }
    },
  };
};
