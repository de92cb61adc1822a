// Cones below the drones in which their wash is felt: a picture of where air goes, no model of it.

import { ConeGeometry, DoubleSide, InstancedMesh, Matrix4, MeshBasicMaterial, Quaternion, Vector3 } from "three";
import type { Maker } from "./element";

/** Half-angle of the cone. */
const OPENING = (12 * Math.PI) / 180;

export const downwash: Maker = (flight, { drone }) => {
  const length = 1.2 * Math.max(...flight.info.cable_lengths);
  const cone = new ConeGeometry(drone + length * Math.tan(OPENING), length, 28, 1, true).rotateX(Math.PI / 2).translate(0, 0, -length / 2);
  const material = new MeshBasicMaterial({ transparent: true, opacity: 0.07, side: DoubleSide, depthWrite: false });
  const object = new InstancedMesh(cone, material, flight.n);
  object.frustumCulled = false;
  const matrix = new Matrix4();
  const at = new Vector3();
  const attitude = new Quaternion();
  const whole = new Vector3(1, 1, 1);
  return {
    object,
    paint: (palette) => material.color.set(palette.wash),
    update(frame, shown) {
      object.visible = shown.downwash;
      if (!shown.downwash) return;
      for (let i = 0; i < frame.n; i++) {
        at.fromArray(frame.positions, 3 * i);
        const [w, x, y, z] = frame.attitudes.subarray(4 * i, 4 * i + 4);
        if (Number.isFinite(w! + x! + y! + z!)) attitude.set(x!, y!, z!, w!);
        else attitude.identity();
        if (Number.isFinite(at.x)) matrix.compose(at, attitude, whole);
        else matrix.makeScale(0, 0, 0);
        object.setMatrixAt(i, matrix);
      }
      object.instanceMatrix.needsUpdate = true;
    },
  };
};
