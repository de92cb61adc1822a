// Where the pilot drags the load to: a marker on a pole, with its place written.

import { BufferGeometry, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, OctahedronGeometry, Vector3 } from "three";
import type { Maker } from "./element";

export const target: Maker = (flight, { drone, floor }) => {
  const object = new Group();
  const marker = new Mesh(new OctahedronGeometry(0.5 * drone), new MeshBasicMaterial({ wireframe: true }));
  const pole = new LineSegments(new BufferGeometry(), new LineBasicMaterial());
  pole.frustumCulled = false;
  object.add(marker, pole);
  const at = new Vector3();
  return {
    object,
    paint(palette) {
      marker.material.color.set(palette.force);
      pole.material.color.set(palette.force);
    },
    update(_frame, _shown, labels) {
      object.visible = flight.target !== null;
      if (!flight.target) return;
      const [x, y, z] = flight.target;
      marker.position.set(x, y, z);
      pole.geometry.setAttribute("position", new Float32BufferAttribute([x, y, z, x, y, floor], 3));
      labels.put(`${x.toFixed(2)}  ${y.toFixed(2)}  ${z.toFixed(2)} m`, at.set(x, y, z + drone), "waypoint");
    },
  };
};
