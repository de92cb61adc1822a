// The side panel: plots, numbers, events, and the mission, one tab each.

import type { Clock } from "./clock";
import type { Flight, Metric } from "./data";
import { button, el, icon } from "./dom";
import { KINDS } from "./tables";

export interface Tab {
  name: string;
  content: HTMLElement;
}

/** A part of the page that follows the clock. */
export interface Part {
  element: HTMLElement;
  update: () => void;
}

export function panel(tabs: Tab[]): HTMLElement {
  const bar = el("div", { class: "tabs", role: "tablist" });
  const body = el("div", { class: "body" });
  const buttons = tabs.map(({ name, content }, k) => {
    const made = button(name, name, () => choose(k));
    made.setAttribute("role", "tab");
    content.setAttribute("role", "tabpanel");
    body.append(content);
    return made;
  });
  const choose = (chosen: number): void =>
    tabs.forEach(({ content }, k) => {
      content.hidden = k !== chosen;
      buttons[k]!.setAttribute("aria-selected", `${k === chosen}`);
    });
  bar.append(...buttons);
  choose(0);
  return el("aside", { class: "panel" }, bar, body);
}

function value(number: number | null): string {
  if (number === null) return "\u2013";
  return Math.abs(number) >= 1000 ? number.toFixed(0) : Number(number.toPrecision(4)).toString();
}

/** The table of metrics; rebuilt where they have changed. */
export function numbers(flights: Flight[]): Part {
  const table = el("table", { class: "numbers" });
  let drawn: Metric[] | null = null;
  const update = (): void => {
    const { metrics } = flights[0]!.info;
    if (metrics === drawn) return;
    drawn = metrics;
    const heads = flights.map((flight) => el("th", {}, flights.length > 1 ? flight.info.label : "value"));
    table.replaceChildren(el("tr", {}, el("th"), ...heads, el("th", {}, "unit")), ...metrics.map((metric) => row(metric, flights)));
  };
  update();
  return { element: el("div", { class: "page" }, table), update };
}

function row(metric: Metric, flights: Flight[]): HTMLElement {
  const cells = flights.map(({ info }) => {
    const found = info.metrics.find((other) => other.name === metric.name);
    return el("td", {}, value(found ? found.value : null));
  });
  const unit = metric.unit === "1" ? "" : metric.unit;
  return el("tr", {}, el("th", { title: metric.name }, metric.meaning), ...cells, el("td", { class: "unit" }, unit));
}

/** The list of events; rebuilt where it has grown. */
export function eventList(flights: Flight[], clock: Clock): Part {
  const list = el("ol", { class: "events" });
  const element = el("div", { class: "page" }, list);
  let drawn = -1;
  const update = (): void => {
    const all = flights.flatMap((flight) => flight.events.map((mark) => ({ mark, flight })));
    if (all.length === drawn) return;
    drawn = all.length;
    all.sort((one, other) => one.mark.time - other.mark.time);
    list.replaceChildren(
      ...all.map(({ mark, flight }) => {
        const made = button(
          "",
          `Go to ${mark.time.toFixed(2)} s`,
          () => clock.seek(mark.time),
          el("span", { class: `sign ${KINDS[mark.kind].tone}`, title: KINDS[mark.kind].word }, icon(KINDS[mark.kind].shape, 12)),
          el("time", {}, `${mark.time.toFixed(2)} s`),
          el("span", {}, mark.text, flights.length > 1 ? el("small", {}, flight.info.label) : ""),
        );
        return el("li", {}, made);
      }),
    );
    if (!all.length) list.replaceChildren(el("li", { class: "none" }, "Nothing happened that needs a mark."));
  };
  return { element, update };
}

export function about(flights: Flight[]): HTMLElement {
  return el(
    "div",
    { class: "page" },
    ...flights.flatMap(({ info }) => [
      el("h2", {}, flights.length > 1 ? `${info.label}: ${info.name}` : info.name),
      el("p", {}, info.description),
      el("dl", {}, ...Object.entries(info.facts).flatMap(([name, text]) => [el("dt", {}, name), el("dd", {}, text)])),
      el("details", {}, el("summary", {}, "Mission as flown"), el("pre", {}, info.mission)),
    ]),
  );
}
