/** All segments as dots: speed against turn. Those that the filter leaves are strong, the chosen one is ringed. */

import type { ExampleColumns } from "../../protocol";
import { el } from "../../ui/dom";

const HEIGHT = 214;
const LEFT = 34;
const RIGHT = 10;
const TOP = 10;
const BOTTOM = 30;

/** Colours of the motions: standing, walking, running, and what leads from one to the other. */
export const MOTION_COLOURS: Record<string, string> = { stand: "#5b6473", walk: "#2b50d8", run: "#c2410c" };
export const BETWEEN_COLOUR = "#0b7a43";
export const colourOf = (motion: string): string => MOTION_COLOURS[motion] ?? BETWEEN_COLOUR;

export class Scatter {
  readonly element: HTMLElement;
  private readonly canvas = el("canvas", {
    class: "scatter-canvas",
    role: "img",
    "aria-label": "Segments by speed and turn; the table below has the same ones",
  });
  private readonly tip = el("div", { class: "tip", hidden: true });
  private columns: ExampleColumns | null = null;
  private motions: string[] = [];
  private kept: ReadonlySet<number> = new Set();
  private chosen = -1;
  private hovered = -1;
  private speeds: [number, number] = [0, 5];
  private turns: [number, number] = [-2, 2];

  constructor(
    private readonly choose: (example: number) => void,
    private readonly words: (example: number) => string,
  ) {
    this.element = el("div", { class: "scatter" }, this.canvas, this.tip);
    this.canvas.addEventListener("pointermove", (event) => this.hover(event));
    this.canvas.addEventListener("pointerleave", () => this.point(-1, 0, 0));
    this.canvas.addEventListener("click", () => this.hovered >= 0 && this.choose(this.hovered));
    new ResizeObserver(() => this.draw()).observe(this.element);
  }

  set(columns: ExampleColumns, motions: string[]): void {
    this.columns = columns;
    this.motions = motions;
    const most = Math.max(1, ...columns.speed);
    const sharp = Math.max(0.5, ...columns.turn.map(Math.abs));
    this.speeds = [0, Math.ceil(most * 2) / 2];
    this.turns = [-Math.ceil(sharp * 2) / 2, Math.ceil(sharp * 2) / 2];
    this.draw();
  }

  show(kept: ReadonlySet<number>, chosen: number): void {
    this.kept = kept;
    this.chosen = chosen;
    this.draw();
  }

  private get width(): number {
    return Math.max(120, this.element.clientWidth);
  }

  private x(speed: number): number {
    return LEFT + ((speed - this.speeds[0]) / (this.speeds[1] - this.speeds[0])) * (this.width - LEFT - RIGHT);
  }

  private y(turn: number): number {
    return TOP + ((this.turns[1] - turn) / (this.turns[1] - this.turns[0])) * (HEIGHT - TOP - BOTTOM);
  }

  private hover(event: PointerEvent): void {
    const { columns } = this;
    if (!columns) return;
    const box = this.canvas.getBoundingClientRect();
    const [px, py] = [event.clientX - box.left, event.clientY - box.top];
    let best = -1;
    let least = 100;
    for (const i of this.kept) {
      const far = (this.x(columns.speed[i]!) - px) ** 2 + (this.y(columns.turn[i]!) - py) ** 2;
      if (far < least) {
        least = far;
        best = i;
      }
    }
    this.point(best, px, py);
  }

  private point(example: number, x: number, y: number): void {
    this.canvas.classList.toggle("on-dot", example >= 0);
    this.tip.hidden = example < 0;
    if (example >= 0) {
      this.tip.textContent = this.words(example);
      this.tip.style.left = `${Math.min(x, this.width - 170)}px`;
      this.tip.style.top = `${y + 14}px`;
    }
    if (example === this.hovered) return;
    this.hovered = example;
    this.draw();
  }

  private draw(): void {
    const { columns, width } = this;
    const ratio = Math.min(2, window.devicePixelRatio);
    this.canvas.width = width * ratio;
    this.canvas.height = HEIGHT * ratio;
    this.canvas.style.height = `${HEIGHT}px`;
    const ink = this.canvas.getContext("2d");
    if (!ink) return;
    ink.scale(ratio, ratio);
    ink.font = "11px system-ui, sans-serif";
    ink.lineWidth = 1;
    ink.fillStyle = "#4f5867";
    ink.strokeStyle = "rgba(20,30,50,.08)";
    ink.textAlign = "center";
    for (let speed = this.speeds[0]; speed <= this.speeds[1]; speed += 1) {
      line(ink, this.x(speed), TOP, this.x(speed), HEIGHT - BOTTOM);
      ink.fillText(String(speed), this.x(speed), HEIGHT - BOTTOM + 13);
    }
    ink.textAlign = "right";
    for (let turn = Math.ceil(this.turns[0]); turn <= this.turns[1]; turn += 1) {
      line(ink, LEFT, this.y(turn), width - RIGHT, this.y(turn));
      ink.fillText(String(turn), LEFT - 6, this.y(turn) + 4);
    }
    ink.fillText("speed, m/s", width - RIGHT, HEIGHT - 4);
    ink.textAlign = "left";
    ink.fillText("turn, rad/s", LEFT + 4, TOP + 8);
    if (!columns) return;
    const dot = (i: number, size: number): void => {
      ink.beginPath();
      ink.arc(this.x(columns.speed[i]!), this.y(columns.turn[i]!), size, 0, Math.PI * 2);
    };
    for (let i = 0; i < columns.speed.length; i++) {
      const kept = this.kept.has(i);
      ink.globalAlpha = kept ? 0.62 : 0.09;
      ink.fillStyle = colourOf(this.motions[columns.group[i]!] ?? "");
      dot(i, kept ? 2.8 : 2.2);
      ink.fill();
    }
    ink.globalAlpha = 1;
    for (const [i, colour] of [
      [this.hovered, "#171b22"],
      [this.chosen, "#171b22"],
    ] as const) {
      if (i < 0 || i >= columns.speed.length) continue;
      ink.strokeStyle = colour;
      ink.lineWidth = 2;
      dot(i, 5.5);
      ink.stroke();
    }
  }
}

function line(ink: CanvasRenderingContext2D, x1: number, y1: number, x2: number, y2: number): void {
  ink.beginPath();
  ink.moveTo(Math.round(x1) + 0.5, y1);
  ink.lineTo(Math.round(x2) + 0.5, y2);
  ink.stroke();
}
