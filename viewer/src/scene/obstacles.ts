// Boxes, upright cylinders and spheres that stand in the way, so thin in colour that the team is seen behind them.

import { BoxGeometry, BufferGeometry, CylinderGeometry, EdgesGeometry, Group, LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, SphereGeometry } from "three";
import type { Maker } from "./element";

/** An obstacle's shape, from its eight numbers: 1 for a cylinder, centre, half sizes, rounding. */
function shape([kind, , , , x, y, z, radius]: number[]): BufferGeometry {
  if (kind === 1) return new CylinderGeometry(x, x, 2 * z!, 32).rotateX(Math.PI / 2);
  return radius! > 0 ? new SphereGeometry(radius, 32, 16) : new BoxGeometry(2 * x!, 2 * y!, 2 * z!);
}

export const obstacles: Maker = (flight) => {
  const object = new Group();
  const faces = new MeshLambertMaterial({ transparent: true, opacity: 0.3, depthWrite: false });
  const edges = new LineBasicMaterial();
  for (const row of flight.info.obstacles) {
    const geometry = shape(row);
    const lines = new LineSegments(new EdgesGeometry(geometry, 40), edges);
    const body = new Mesh(geometry, faces);
    body.position.set(row[1]!, row[2]!, row[3]!);
    object.add(body.add(lines));
  }
  return {
    object,
    paint(palette) {
      faces.color.set(palette.obstacle);
      edges.color.set(palette.obstacle);
    },
    update() {},
  };
};
