/** Somebody who was asked about: what they are up to and why, their way, and the room that they have reserved. */

import type { Mesh } from "three";
import type { Connection } from "../../connection";
import type { ExplanationMessage } from "../../protocol";
import { palette } from "../../stage/palette";
import { Ribbon } from "../../stage/ribbon";
import { iconButton } from "../../ui/controls";
import { el, replace } from "../../ui/dom";
import { icons } from "../../ui/icons";

export class Asking {
  readonly element = el("div");
  /** The number of whom it is about. */
  who: number | null = null;
  private readonly path = new Ribbon({
    colour: palette.accent,
    width: 0.07,
    height: 0.03,
    capacity: 600,
    opacity: 0.9,
    fades: false,
  });
  private readonly window = new Ribbon({
    colour: palette.chosen,
    width: 0.6,
    height: 0.026,
    capacity: 600,
    opacity: 0.42,
    fades: false,
  });

  constructor(private readonly connection: Connection) {
    connection.on("explanation", (told) => this.explain(told));
  }

  /** What lies on the ground. */
  get meshes(): Mesh[] {
    return [this.path.mesh, this.window.mesh];
  }

  update(): void {
    this.path.update();
    this.window.update();
  }

  ask(id: number | null): void {
    this.who = id;
    this.connection.send({ type: "explain", person: id });
    if (id === null) {
      this.path.clear();
      this.window.clear();
      replace(this.element);
    }
  }

  private explain(told: ExplanationMessage): void {
    if (told.person !== this.who) return;
    this.path.set(told.gone ? [] : told.path.flat());
    this.window.set(told.gone ? [] : told.window.flat());
    const facts: [string, string][] = [];
    if (told.other) facts.push(["Answers", told.other]);
    if (told.contact_in !== null) facts.push(["Would meet in", `${told.contact_in.toFixed(1)} s`]);
    if (told.side) facts.push(["Passes on the", told.side]);
    facts.push(["Aims at", `${Math.hypot(...told.target).toFixed(2)} m/s`]);
    const let_go = iconButton("Ask about nobody", icons.close, () => this.ask(null), "Esc");
    let_go.classList.add("small");
    const title = el("h2", {}, el("span", {}, told.name || `person ${told.person}`), let_go);
    const told_ = told.gone
      ? [el("p", { class: "why" }, "Has left the scene.")]
      : [
          el("p", { class: "rule" }, told.rule),
          el("p", { class: "why" }, `${told.why[0]?.toUpperCase() ?? ""}${told.why.slice(1)}.`),
          el(
            "dl",
            { class: "readings" },
            ...facts.map(([name, value]) => el("div", { class: "reading" }, el("dt", {}, name), el("dd", {}, value))),
          ),
          el(
            "p",
            { class: "keyline" },
            el("span", { class: "swatch path" }),
            "way that is left",
            el("span", { class: "swatch window" }),
            "reserved to brake",
          ),
        ];
    replace(this.element, el("section", { class: "section explained" }, title, ...told_));
  }
}
