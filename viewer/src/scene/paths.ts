// The reference's whole path, dashed, and the load's path up to now.

import { Group } from "three";
import { Line2 } from "three/examples/jsm/lines/Line2.js";
import { LineGeometry } from "three/examples/jsm/lines/LineGeometry.js";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import type { Column, Flight } from "../data";
import type { Maker } from "./element";

/** Most points of a path. */
const POINTS = 2500;

export const paths: Maker = (flight) => {
  const object = new Group();
  const wanted = new Line2(
    new LineGeometry(),
    new LineMaterial({ linewidth: 1.6, dashed: true, dashSize: 0.06, gapSize: 0.05 }),
  );
  const flown = new Line2(new LineGeometry(), new LineMaterial({ linewidth: 2.2, transparent: true, opacity: 0.9 }));
  wanted.frustumCulled = flown.frustumCulled = false;
  object.add(wanted, flown);
  let version = -1;
  let stride = 1;
  return {
    object,
    paint(palette) {
      wanted.material.color.set(palette.reference);
      flown.material.color.set(palette.load);
    },
    update(frame, shown) {
      object.visible = shown.paths && flight.rows > 1;
      if (!object.visible) return;
      if (version !== flight.version) {
        version = flight.version;
        stride = Math.ceil(flight.rows / POINTS);
        shape(wanted, flight, flight.columns.reference, stride);
        shape(flown, flight, flight.columns.load, stride);
        wanted.computeLineDistances();
      }
      flown.geometry.instanceCount = Math.floor(frame.row / stride);
    },
  };
};

function shape(line: Line2, flight: Flight, column: Column, stride: number): void {
  const points: number[] = [];
  let last = [0, 0, 0];
  for (let row = 0; row < flight.rows; row += stride) {
    const point = [column.at(row, 0), column.at(row, 1), column.at(row, 2)];
    if (point.every(Number.isFinite)) last = point;
    points.push(...last);
  }
  if (points.length < 6) points.push(...last);
  line.geometry.dispose();
  line.geometry = new LineGeometry().setPositions(points);
}
