/** The frame of the page: name, modes, how the connection fares, panels, help. */

import type { Connection, Link } from "../connection";
import type { Mode, ModeName } from "../modes/mode";
import { button, iconButton } from "./controls";
import { el, replace, setText, svg } from "./dom";
import { icons } from "./icons";
import type { Messages } from "./messages";

const TITLES: Record<ModeName, string> = { walk: "Walk", scene: "Scene", database: "Database" };

type Side = "left" | "right";

export class Shell {
  readonly element = el("div", { class: "page" });
  private readonly tabs = new Map<ModeName, HTMLButtonElement>();
  private readonly panels = {
    left: el("aside", { class: "panel left", id: "panel-left", "aria-label": "Controls" }),
    right: el("aside", { class: "panel right", id: "panel-right", "aria-label": "What is going on" }),
  };
  /** On narrow screens one panel, or none, lies over the lower part of the stage; these buttons choose it. */
  private readonly drawers = {
    left: button("Controls", () => this.pull("left"), { kind: "quiet" }),
    right: button("What is going on", () => this.pull("right"), { kind: "quiet" }),
  };
  private readonly foot = el("footer", { class: "foot" });
  private readonly link = el("span", { class: "link-text", role: "status" }, "Connecting");
  private readonly lamp = el("span", { class: "link-lamp" });
  private readonly name = el("span", { class: "database-name" });
  private readonly curtain = el(
    "div",
    { class: "curtain" },
    el("p", { class: "curtain-text", role: "status" }, "Waking up …"),
  );
  private readonly dialog: HTMLDialogElement;
  private readonly helpBody = el("div", { class: "help-body" });

  constructor(
    stage: HTMLElement,
    messages: Messages,
    private readonly connection: Connection,
    modes: readonly Mode[],
    choose: (name: ModeName) => void,
    private readonly options: HTMLElement,
  ) {
    const tabs = el("nav", { class: "modes", "aria-label": "Modes" });
    for (const mode of modes) {
      const tab = el("button", { type: "button", class: "mode", "aria-pressed": "false" }, TITLES[mode.name]);
      tab.addEventListener("click", () => choose(mode.name));
      this.tabs.set(mode.name, tab);
      tabs.append(tab);
    }
    this.dialog = el(
      "dialog",
      { class: "help", "aria-labelledby": "help-title" },
      el("h2", { id: "help-title" }, "Keys and gestures"),
      this.helpBody,
    );
    const close = button("Close", () => this.dialog.close(), { kind: "primary" });
    this.dialog.append(el("div", { class: "dialog-foot" }, close));
    this.dialog.addEventListener("click", (event) => event.target === this.dialog && this.dialog.close());
    const eye = iconButton("Picture", icons.orbit, () => this.toggleOptions());
    eye.setAttribute("aria-expanded", "false");
    this.eye = eye;
    const header = el(
      "header",
      { class: "bar" },
      el("h1", { class: "brand" }, mark(), "stridecast"),
      tabs,
      el(
        "div",
        { class: "bar-end" },
        this.name,
        el("span", { class: "link" }, this.lamp, this.link),
        eye,
        iconButton("Keys and gestures", icons.help, () => this.help(), "?"),
      ),
    );
    options.hidden = true;
    options.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      event.stopPropagation();
      this.toggleOptions();
      eye.focus();
    });
    this.element.append(
      el(
        "a",
        {
          class: "skip",
          href: "#stage",
          onclick: (event: Event) => (event.preventDefault(), stage.querySelector("canvas")?.focus()),
        },
        "To the stage",
      ),
      header,
      el(
        "main",
        { class: "main" },
        el("nav", { class: "drawers", "aria-label": "Panels" }, this.drawers.left, this.drawers.right),
        this.panels.left,
        stage,
        this.panels.right,
        options,
        messages.element,
        this.curtain,
      ),
      this.foot,
      this.dialog,
    );
    for (const side of ["left", "right"] as const) this.drawers[side].setAttribute("aria-controls", `panel-${side}`);
    this.pull("left");
    connection.onLink((link) => this.linked(link));
    setInterval(() => this.linked(connection.link), 500);
  }

  private readonly eye: HTMLButtonElement;

  /** Pull a panel out, or push it back if it is out. */
  private pull(side: Side): void {
    const out = this.element.dataset.panel === side ? null : side;
    this.element.dataset.panel = out ?? "none";
    for (const each of ["left", "right"] as const)
      this.drawers[each].setAttribute("aria-expanded", String(each === out));
  }

  private toggleOptions(): void {
    this.options.hidden = !this.options.hidden;
    this.eye.setAttribute("aria-expanded", String(!this.options.hidden));
  }

  show(mode: Mode): void {
    for (const [name, tab] of this.tabs) tab.setAttribute("aria-pressed", String(name === mode.name));
    replace(this.panels.left, mode.left);
    replace(this.panels.right, mode.right);
    replace(this.foot, mode.foot);
    replace(
      this.helpBody,
      el(
        "dl",
        { class: "keys" },
        ...mode.help.map(([keys, meaning]) => el("div", {}, el("dt", {}, keys), el("dd", {}, meaning))),
      ),
    );
    this.element.dataset.mode = mode.name;
    document.title = `${TITLES[mode.name]} · stridecast`;
  }

  help(): void {
    if (this.dialog.open) this.dialog.close();
    else this.dialog.showModal();
  }

  get busy(): boolean {
    return this.dialog.open;
  }

  database(name: string): void {
    setText(this.name, name);
    this.name.title = "Database in use";
  }

  /** Lift the curtain, or let it down with a word. */
  ready(text: string | null): void {
    this.curtain.classList.toggle("lifted", text === null);
    if (text !== null) setText(this.curtain.firstElementChild!, text);
  }

  private linked(link: Link): void {
    this.element.dataset.link = link;
    const { connection } = this;
    const left = Math.max(0, Math.ceil((connection.retryAt - performance.now()) / 1000));
    const words: Record<Link, string> = {
      connecting: "Connecting",
      open: connection.roundTrip === null ? "Connected" : `Connected · ${connection.roundTrip.toFixed(0)} ms`,
      waiting: left > 0 ? `No server · again in ${left} s` : "No server · trying again",
      refused: "Reload the page",
    };
    setText(this.link, words[link]);
  }
}

function mark(): SVGElement {
  return svg(
    "svg",
    { viewBox: "0 0 32 32", class: "brand-mark", "aria-hidden": "true" },
    svg("rect", { width: 32, height: 32, rx: 9 }),
    svg("ellipse", { cx: 12, cy: 20.5, rx: 3.4, ry: 5.2, transform: "rotate(-12 12 20.5)" }),
    svg("ellipse", { cx: 20.5, cy: 11.5, rx: 3.4, ry: 5.2, transform: "rotate(12 20.5 11.5)" }),
  );
}
