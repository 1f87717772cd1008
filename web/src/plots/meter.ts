/** A quantity and the bound that it must keep, as a bar; it lights up while the bound acts. */

import { el, setText } from "../ui/dom";

const GLOW = 260;

export class Meter {
  readonly element: HTMLElement;
  private readonly fill = el("span", { class: "meter-fill" });
  private readonly low = el("span", { class: "meter-mark" });
  private readonly number = el("span", { class: "meter-number" });
  private readonly state = el("span", { class: "visually-hidden" });
  private litUntil = 0;
  private lit = false;

  constructor(
    readonly name: string,
    title: string,
    private readonly unit: string,
  ) {
    this.element = el(
      "li",
      { class: "meter", title },
      el("span", { class: "lamp" }),
      el("span", { class: "meter-name" }, name),
      this.number,
      el("span", { class: "meter-bar" }, this.fill, this.low),
      this.state,
    );
  }

  /** `low` is negative for a quantity with two signs; the bar then begins in the middle. */
  set(value: number, low: number, high: number, acted: boolean, now: number): void {
    if (acted) this.litUntil = now + GLOW;
    const span = high - low || 1;
    const at = (x: number): number => Math.min(100, Math.max(0, ((x - low) / span) * 100));
    const zero = at(0);
    const here = at(value);
    this.fill.style.left = `${Math.min(zero, here)}%`;
    this.fill.style.width = `${Math.abs(here - zero)}%`;
    this.low.style.left = `${zero}%`;
    setText(this.number, `${value.toFixed(2)} / ${(value < 0 ? low : high).toFixed(2)} ${this.unit}`);
    this.tick(now);
  }

  tick(now: number): void {
    const lit = now < this.litUntil;
    if (lit === this.lit) return;
    this.lit = lit;
    this.element.classList.toggle("lit", lit);
    setText(this.state, lit ? "acts" : "");
  }
}
