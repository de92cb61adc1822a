// The load, and where it should be.

import { Group, IcosahedronGeometry, Mesh, MeshBasicMaterial, MeshLambertMaterial, TorusGeometry } from "three";
import type { Maker } from "./element";

export const load: Maker = (_flight, { drone }) => {
  const object = new Group();
  const body = new Mesh(new IcosahedronGeometry(0.42 * drone, 1), new MeshLambertMaterial({ flatShading: true }));
  const wanted = new Mesh(
    new TorusGeometry(0.62 * drone, 0.035 * drone, 6, 40),
    new MeshBasicMaterial(),
  );
  object.add(body, wanted);
  return {
    object,
    paint(palette) {
      body.material.color.set(palette.load);
      wanted.material.color.set(palette.reference);
    },
    update(frame, shown) {
      body.position.fromArray(frame.load);
      body.visible = Number.isFinite(frame.load[0]);
      wanted.position.fromArray(frame.reference);
      wanted.visible = shown.paths && Number.isFinite(frame.reference[0]);
    },
  };
};
