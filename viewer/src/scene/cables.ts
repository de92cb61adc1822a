// Cables: straight and coloured by tension; a slack one sags as far as the ground, dashed; one of unknown tension is grey.

import { Group, Vector3 } from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import { cableEnd } from "../data";
import { tensionColour, theme, type Palette } from "../theme";
import type { Maker } from "./element";

/** Below this part of the colour scale a cable is drawn slack. */
const SLACK = 1e-4;
const PIECES = 25;

export const cables: Maker = (flight) => {
  const object = new Group();
  const taut = new LineSegments2(new LineSegmentsGeometry(), new LineMaterial({ linewidth: 3.4, vertexColors: true }));
  const loose = new LineSegments2(new LineSegmentsGeometry(), new LineMaterial({ linewidth: 2.4 }));
  taut.frustumCulled = loose.frustumCulled = false;
  object.add(taut, loose);
  let palette: Palette = theme.palette;

  const from = new Vector3();
  const to = new Vector3();
  const point = new Vector3();
  return {
    object,
    paint(now) {
      palette = now;
      loose.material.color.set(now.soft);
    },
    update(frame) {
      // On the ground a cable lies; just above it, so that it is seen.
      const lowest = (flight.info.ground ?? -Infinity) + 0.004;
      const straight: number[] = [];
      const colours: number[] = [];
      const sagging: number[] = [];
      for (let i = 0; i < frame.n; i++) {
        from.fromArray(frame.positions, 3 * i);
        to.fromArray(cableEnd(frame, i));
        const tension = frame.tensions[i]!;
        if (!Number.isFinite(from.lengthSq() + to.lengthSq())) continue;
        if (!Number.isFinite(tension) || tension > SLACK * flight.full) {
          straight.push(...from, ...to);
          const { r, g, b } = tensionColour(tension / flight.full, palette);
          colours.push(r, g, b, r, g, b);
          continue;
        }
        // A parabola of the cable's length between its ends, never so flat that it looks taut.
        const reeled = frame.reeled[i]!;
        const length = flight.info.cable_lengths[i]! + (Number.isFinite(reeled) ? reeled : 0);
        const chord = from.distanceTo(to);
        const sag = Math.max(0.1 * length, Math.sqrt(Math.max(0.375 * chord * (length - chord), 0)));
        for (let k = 0; k < PIECES; k += 2) {
          for (const part of [k / PIECES, (k + 1) / PIECES]) {
            point.lerpVectors(from, to, part);
            const height = point.z - 4 * sag * part * (1 - part);
            sagging.push(point.x, point.y, Math.max(height, Math.min(point.z, lowest)));
          }
        }
      }
      fill(taut, straight, colours);
      fill(loose, sagging);
    },
  };
};

function fill(line: LineSegments2, points: number[], colours?: number[]): void {
  line.visible = points.length > 0;
  if (!line.visible) return;
  line.geometry.dispose();
  line.geometry = new LineSegmentsGeometry().setPositions(points);
  if (colours) line.geometry.setColors(colours);
}
