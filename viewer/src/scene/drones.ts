// The drones: a body with four arms whose front pair carries the drone's colour, and turning rotors.

import { BoxGeometry, BufferGeometry, CircleGeometry, CylinderGeometry, DoubleSide, Group, InstancedMesh, Matrix4, MeshBasicMaterial, MeshLambertMaterial, Quaternion, TorusGeometry, Vector3 } from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import { theme } from "../theme";
import type { Maker } from "./element";

const ARM = 0.68;
/** Rotor hubs, in half spans: front left, back left, back right, front right; neighbours turn in opposite ways. */
const HUBS = [1, 3, 5, 7].map((k) => [ARM * Math.cos((k * Math.PI) / 4), ARM * Math.sin((k * Math.PI) / 4)] as const);
const ROTOR = 0.36;

function arms(front: boolean): BufferGeometry {
  const parts = HUBS.filter(([x]) => x > 0 === front).flatMap(([x, y]) => {
    const arm = new BoxGeometry(ARM, 0.09, 0.06).translate(ARM / 2, 0, 0).rotateZ(Math.atan2(y, x));
    const motor = new CylinderGeometry(0.08, 0.09, 0.14, 12).rotateX(Math.PI / 2).translate(x, y, 0.04);
    const guard = new TorusGeometry(ROTOR, 0.018, 6, 28).translate(x, y, 0.1);
    return [arm, motor, guard];
  });
  return mergeGeometries(parts)!;
}

function body(): BufferGeometry {
  const hull = new CylinderGeometry(0.2, 0.24, 0.13, 8).rotateX(Math.PI / 2);
  const battery = new BoxGeometry(0.3, 0.16, 0.08).translate(0, 0, 0.1);
  const feet = [-1, 1].map((side) => new BoxGeometry(0.34, 0.03, 0.03).translate(0, 0.17 * side, -0.16));
  return mergeGeometries([hull, battery, ...feet])!;
}

export const drones: Maker = (flight, scale) => {
  const object = new Group();
  const { n } = flight;
  const dark = new MeshLambertMaterial();
  const coloured = new MeshLambertMaterial({ color: "#ffffff" });
  const discs = new MeshBasicMaterial({ transparent: true, opacity: 0.16, side: DoubleSide, depthWrite: false });
  const meshes = {
    hull: new InstancedMesh(mergeGeometries([body(), arms(false)])!, dark, n),
    front: new InstancedMesh(arms(true), coloured, n),
    blades: new InstancedMesh(new BoxGeometry(2 * ROTOR, 0.05, 0.012), dark, 4 * n),
    discs: new InstancedMesh(new CircleGeometry(ROTOR, 24), discs, 4 * n),
  };
  for (const mesh of Object.values(meshes)) {
    mesh.frustumCulled = false;
    object.add(mesh);
  }

  const pose = new Matrix4();
  const hub = new Matrix4();
  const gone = new Matrix4().makeScale(0, 0, 0);
  const at = new Vector3();
  const aside = new Vector3();
  const attitude = new Quaternion();
  // As large as they are, or as the scene has them where that is not known.
  const spans = Array.from({ length: n }, (_, i) => {
    const radius = flight.info.radii[i] ?? null;
    return radius === null ? scale.drone : radius / (ARM + ROTOR);
  });
  const size = new Vector3();
  return {
    object,
    paint(palette) {
      dark.color.set(palette.body);
      discs.color.set(palette.ink);
      for (let i = 0; i < n; i++) meshes.front.setColorAt(i, coloured.color.clone().set(theme.drone(i).colour));
      meshes.front.instanceColor!.needsUpdate = true;
    },
    update(frame, shown, labels) {
      for (let i = 0; i < n; i++) {
        at.fromArray(frame.positions, 3 * i);
        const there = Number.isFinite(at.x + at.y + at.z);
        const [w, x, y, z] = frame.attitudes.subarray(4 * i, 4 * i + 4);
        if (Number.isFinite(w! + x! + y! + z!)) attitude.set(x!, y!, z!, w!).normalize();
        else attitude.identity();
        if (there) pose.compose(at, attitude, size.setScalar(spans[i]!));
        else pose.copy(gone);
        meshes.hull.setMatrixAt(i, pose);
        meshes.front.setMatrixAt(i, pose);
        HUBS.forEach(([hx, hy], k) => {
          const phase = frame.spin[i]! * (k % 2 ? -1 : 1) + k;
          hub.makeRotationZ(phase).setPosition(hx, hy, 0.12).premultiply(pose);
          meshes.blades.setMatrixAt(4 * i + k, hub);
          meshes.discs.setMatrixAt(4 * i + k, hub);
        });
        if (there && shown.labels && n <= 16) {
          const tension = frame.tensions[i]!;
          const text = Number.isFinite(tension) ? `${i}  ${tension.toFixed(2)} N` : `${i}`;
          // Outwards from the load, where neither cable nor arrow is.
          aside.set(frame.positions[3 * i]! - frame.load[0]!, frame.positions[3 * i + 1]! - frame.load[1]!, 0);
          if (aside.lengthSq() > 0) at.addScaledVector(aside.normalize(), 1.9 * spans[i]!);
          labels.put(text, at, "drone");
        }
      }
      for (const mesh of Object.values(meshes)) mesh.instanceMatrix.needsUpdate = true;
    },
  };
};
