// Of a rigid load, whose cables need not meet: the two drones nearest to each other, with their distance written.

import { BufferGeometry, Group, Line, LineBasicMaterial, Vector3 } from "three";
import { nearest as nearestOf } from "../data";
import { MOST_PAIRED } from "../tables";
import type { Maker } from "./element";

export const nearest: Maker = (flight) => {
  const object = new Group();
  const line = new Line(new BufferGeometry(), new LineBasicMaterial({ transparent: true, opacity: 0.7 }));
  line.frustumCulled = false;
  object.add(line);
  const [from, to] = [new Vector3(), new Vector3()];
  let colours = { near: "", far: "" };
  return {
    object,
    paint(palette) {
      colours = { near: palette.warn, far: palette.soft };
    },
    update(frame, shown, labels) {
      const { one, other, distance } = nearestOf(frame.positions, shown.angles && flight.info.body && frame.n <= MOST_PAIRED ? frame.n : 0);
      object.visible = one >= 0;
      if (one < 0) return;
      from.fromArray(frame.positions, 3 * one);
      to.fromArray(frame.positions, 3 * other);
      line.geometry.setFromPoints([from, to]);
      const near = distance < (flight.info.safe_distance ?? 0);
      line.material.color.set(near ? colours.near : colours.far);
      labels.put(`${distance.toFixed(2)} m`, from.lerp(to, 0.5), near ? "angle" : "scale");
    },
  };
};
