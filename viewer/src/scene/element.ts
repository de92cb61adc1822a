// What a thing in the scene is: it builds itself once and follows frames and colours from then on.

import type { Object3D, Vector3 } from "three";
import type { Flight, Frame } from "../data";
import type { Palette } from "../theme";

/** What the viewer can switch on and off. */
export interface Shown {
  forces: boolean;
  paths: boolean;
  angles: boolean;
  labels: boolean;
  downwash: boolean;
}

/** Writes text at points of the scene, for this frame. */
export interface Labels {
  put(text: string, at: Vector3, kind: string): void;
}

export interface Element {
  object: Object3D;
  paint(palette: Palette): void;
  update(frame: Frame, shown: Shown, labels: Labels): void;
}

/** Size of things that have no size in a recording, m. */
export interface Scale {
  /** Half the span of a drone. */
  drone: number;
  /** Height of the ground. */
  floor: number;
  /** Middle of where things fly, and how far from it they get. */
  centre: Vector3;
  radius: number;
}

export type Maker = (flight: Flight, scale: Scale) => Element;
