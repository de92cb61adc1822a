// Dark and light; colours of drones, flights and tension that hold for any colour vision.

import { Color } from "three";

export interface Palette {
  name: "dark" | "light";
  back: string;
  ground: string;
  shade: string;
  line: string;
  ink: string;
  soft: string;
  drones: string[];
  flights: string[];
  tension: string[];
  unknown: string;
  reference: string;
  force: string;
  external: string;
  thrust: string;
  warn: string;
  wash: string;
  body: string;
  load: string;
  obstacle: string;
}

const DARK: Palette = {
  name: "dark",
  back: "#0e1318",
  ground: "#182027",
  shade: "#05080a",
  line: "#34404b",
  ink: "#e6ebf0",
  soft: "#8e9ba8",
  drones: ["#56b4e9", "#f0883e", "#2fc79a", "#e08bc0", "#f2c14e", "#9fb8ff", "#c2a878", "#b79af0"],
  flights: ["#7cc4ff", "#ffb454", "#b79af0"],
  tension: ["#3f5f94", "#5f8fb8", "#9fb9a6", "#e6cf72", "#fff3bf"],
  unknown: "#7c8791",
  reference: "#aab6c2",
  force: "#5fd0a5",
  external: "#ff8a80",
  thrust: "#8fb7ff",
  warn: "#ff7b6b",
  wash: "#7fb2ff",
  body: "#c9d2da",
  load: "#d9a066",
  obstacle: "#8d7f9e",
};

const LIGHT: Palette = {
  name: "light",
  back: "#f4f6f8",
  ground: "#e6eaee",
  shade: "#41505e",
  line: "#c2cbd3",
  ink: "#1b2229",
  soft: "#5b6773",
  drones: ["#0072b2", "#d55e00", "#009e73", "#b8559a", "#b97f00", "#4766c9", "#7f6000", "#5d3a9b"],
  flights: ["#0b62a8", "#c45500", "#5d3a9b"],
  tension: ["#9cc3e6", "#6f93c4", "#7b6f9c", "#8f4a4a", "#6b1500"],
  unknown: "#8b959e",
  reference: "#6a7681",
  force: "#007a56",
  external: "#b3261e",
  thrust: "#2f5fb3",
  warn: "#c4231a",
  wash: "#3f7fd0",
  body: "#3c4650",
  load: "#8a5a2b",
  obstacle: "#75678a",
};

export const DASHES: number[][] = [[], [7, 3], [2, 2], [8, 3, 2, 3], [12, 3], [4, 2, 1, 2], [3, 5], [12, 2, 2, 2]];

type Listener = (palette: Palette) => void;

class Theme {
  palette: Palette = DARK;
  private readonly listeners = new Set<Listener>();

  start(wanted?: string): void {
    const system = matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
    this.set(wanted ?? system);
  }

  set(name: string): void {
    this.palette = name === "light" ? LIGHT : DARK;
    document.documentElement.dataset.theme = this.palette.name;
    for (const listener of this.listeners) listener(this.palette);
  }

  toggle(): void {
    this.set(this.palette.name === "dark" ? "light" : "dark");
  }

  onChange(listener: Listener): void {
    this.listeners.add(listener);
    listener(this.palette);
  }

  drone(i: number): { colour: string; dash: number[] } {
    const { drones } = this.palette;
    return { colour: drones[i % drones.length]!, dash: DASHES[i % DASHES.length]! };
  }
}

export const theme = new Theme();

const mixed = new Color();
const other = new Color();

/** Colour of a tension, as a part of the scale from 0 to 1; grey when unknown. */
export function tensionColour(part: number, palette: Palette): Color {
  if (!Number.isFinite(part)) return mixed.set(palette.unknown);
  const steps = palette.tension.length - 1;
  const place = Math.min(Math.max(part, 0), 1) * steps;
  const k = Math.min(Math.floor(place), steps - 1);
  return mixed.set(palette.tension[k]!).lerp(other.set(palette.tension[k + 1]!), place - k);
}
