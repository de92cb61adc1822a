// Entry: a page that carries flights replays them; one that carries none connects to its server.

import "uplot/dist/uPlot.min.css";
import "./style.css";
import { Flight, type Payload } from "./data";
import { Cockpit } from "./layout";
import { Session } from "./live/session";
import { theme } from "./theme";

const root = document.getElementById("app")!;
const carried = document.getElementById("colift-data");

function replay(data: Payload): void {
  theme.start(data.view.theme);
  const cockpit = new Cockpit(root, data.flights.map(Flight.unpack), data.view);
  automate(cockpit);
}

/** What tests and `colift render` drive the page with. */
function automate(cockpit: Cockpit): void {
  const { clock } = cockpit;
  Object.assign(window, {
    colift: {
      seek: (time: number) => clock.seek(time),
      play: (on?: boolean) => clock.play(on),
      camera: (view: "orbit" | "follow" | "top" | "side") => cockpit.look(view),
      state: () => ({
        time: clock.time,
        end: clock.end,
        playing: clock.playing,
        speed: clock.speed,
        view: cockpit.view,
        theme: theme.palette.name,
        shown: { ...cockpit.shown },
        flights: cockpit.frames.map((frame, k) => ({
          label: cockpit.flights[k]!.info.label,
          rows: cockpit.flights[k]!.rows,
          events: cockpit.flights[k]!.events.length,
          ...Object.fromEntries(Object.entries(frame).map(([name, value]) => [name, typeof value === "number" ? value : Array.from(value)])),
        })),
      }),
    },
  });
}

if (carried) replay(JSON.parse(carried.textContent!) as Payload);
else {
  theme.start();
  new Session(root, automate);
}
