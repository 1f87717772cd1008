/** A running plot of a quantity between its bounds, of the last seconds. */

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { el } from "../ui/dom";

const SECONDS = 8;
const CAPACITY = 30 * SECONDS + 30;

const INK = { line: "#2b50d8", bound: "#8a93a3", band: "rgba(138,147,163,.16)", axis: "#5b6473", hit: "#c2410c" };

export class Strip {
  readonly element: HTMLElement;
  private readonly plot: uPlot;
  private readonly times: number[] = [];
  private readonly values: (number | null)[] = [];
  private readonly least: (number | null)[] = [];
  private readonly most: (number | null)[] = [];
  private readonly hits: (number | null)[] = [];
  private dirty = false;

  constructor(
    title: string,
    unit: string,
    private readonly range: [number, number],
  ) {
    const holder = el("div", { class: "strip-plot" });
    this.element = el(
      "figure",
      { class: "strip", "aria-label": `${title} of the last ${SECONDS} seconds, between its bounds` },
      el("figcaption", {}, title, el("span", { class: "unit" }, unit)),
      holder,
    );
    const font = "10.5px system-ui, sans-serif";
    this.plot = new uPlot(
      {
        width: 256,
        height: 56,
        padding: [4, 2, 0, 0],
        cursor: { show: false },
        legend: { show: false },
        scales: {
          x: { time: false, range: () => this.window() },
          y: { range: () => this.reach() },
        },
        axes: [
          { show: false },
          {
            size: 30,
            gap: 3,
            font,
            stroke: INK.axis,
            splits: (u) => {
              const [low, high] = [u.scales.y!.min ?? 0, u.scales.y!.max ?? 1];
              const step = niceStep((high - low) / 3);
              const first = Math.ceil(low / step) * step;
              return Array.from(
                { length: Math.floor((high - first) / step + 1e-6) + 1 },
                (_, i) => +(first + i * step).toFixed(6),
              );
            },
            values: (_, splits) => splits.map((v) => String(+v.toFixed(2))),
            grid: { stroke: "rgba(20,30,50,.07)", width: 1 },
            ticks: { show: false },
          },
        ],
        series: [
          {},
          { stroke: INK.bound, width: 1, dash: [3, 3], points: { show: false } },
          { stroke: INK.bound, width: 1, dash: [3, 3], points: { show: false } },
          { stroke: INK.line, width: 1.8, points: { show: false } },
          { stroke: INK.hit, width: 2.6, points: { show: false } },
        ],
        bands: [{ series: [1, 2], fill: INK.band }],
      },
      [[], [], [], [], []],
      holder,
    );
    new ResizeObserver(() => {
      const width = holder.clientWidth;
      if (width > 0) this.plot.setSize({ width, height: 56 });
    }).observe(holder);
  }

  /** One more frame; `hit` when the bound acted in it. */
  add(time: number, value: number, least: number, most: number, hit: boolean): void {
    if (this.times.length && time <= this.times[this.times.length - 1]!) this.clear();
    this.times.push(time);
    this.values.push(value);
    this.least.push(least);
    this.most.push(most);
    this.hits.push(hit ? value : null);
    if (this.times.length > CAPACITY)
      for (const list of [this.times, this.values, this.least, this.most, this.hits]) list.shift();
    this.dirty = true;
  }

  clear(): void {
    for (const list of [this.times, this.values, this.least, this.most, this.hits]) list.length = 0;
    this.dirty = true;
  }

  update(): void {
    if (!this.dirty) return;
    this.dirty = false;
    this.plot.setData([this.times, this.most, this.least, this.values, this.hits] as uPlot.AlignedData, true);
  }

  private window(): [number, number] {
    const last = this.times[this.times.length - 1] ?? SECONDS;
    return [last - SECONDS, last];
  }

  private reach(): [number, number] {
    let [low, high] = this.range;
    for (const list of [this.values, this.least, this.most]) {
      for (const value of list) {
        if (value === null || !Number.isFinite(value)) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
    const room = (high - low) * 0.06;
    return [low - room, high + room];
  }
}

function niceStep(about: number): number {
  const power = Math.pow(10, Math.floor(Math.log10(Math.max(about, 1e-9))));
  const lead = about / power;
  return (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10) * power;
}
