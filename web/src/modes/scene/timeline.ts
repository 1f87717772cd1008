/** Play, pause, step, pace, and the line of what was recorded. */

import type { Connection } from "../../connection";
import { PACES, type PlayerState } from "../../protocol";
import { iconButton } from "../../ui/controls";
import { el, replace, setText } from "../../ui/dom";
import { icons } from "../../ui/icons";

const STEPS = [0.25, 0.5, 1, 2, 4, 8].filter((pace) => pace >= PACES[0] && pace <= PACES[1]);

export class Timeline {
  readonly element: HTMLElement;
  playing = false;
  private pace = 1;
  private readonly play: HTMLButtonElement;
  private readonly paceText = el("output", { class: "pace", "aria-label": "Pace" }, "1×");
  private readonly line = el("input", {
    type: "range",
    class: "scrub",
    min: 0,
    max: 0,
    step: 0.01,
    "aria-label": "Time",
  });
  private readonly clock = el("span", { class: "clock" }, "0.0 s");
  private readonly counts = el("span", { class: "counts" });
  private scrubbing = false;

  /** `before` is done before anything plays, as what has been edited but not told yet must not be played over. */
  constructor(
    private readonly connection: Connection,
    private readonly before: () => void = () => {},
  ) {
    this.play = iconButton("Play", icons.play, () => this.toggle(), "Space");
    this.line.addEventListener("input", () => {
      this.scrubbing = true;
      connection.send({ type: "scrub", time: Number(this.line.value) });
      this.fill();
    });
    this.line.addEventListener("change", () => (this.scrubbing = false));
    this.element = el(
      "div",
      { class: "timeline", role: "group", "aria-label": "Player" },
      iconButton("From the beginning", icons.restart, () => this.restart(), "Home"),
      this.play,
      iconButton("One frame", icons.step, () => this.step(), "."),
      iconButton("Slower", icons.slower, () => this.faster(-1), "["),
      this.paceText,
      iconButton("Faster", icons.faster, () => this.faster(1), "]"),
      this.line,
      el("span", { class: "clock-box" }, this.clock, this.counts),
    );
  }

  toggle(): void {
    this.before();
    this.connection.send({ type: "playback", action: this.playing ? "pause" : "play" });
  }

  step(): void {
    this.before();
    this.connection.send({ type: "playback", action: "step" });
  }

  restart(): void {
    this.before();
    this.connection.send({ type: "playback", action: "restart" });
  }

  faster(by: number): void {
    const at = STEPS.findIndex((pace) => pace >= this.pace - 1e-6);
    this.pace = STEPS[Math.min(STEPS.length - 1, Math.max(0, at + by))]!;
    this.connection.send({ type: "pace", factor: this.pace });
    setText(this.paceText, `${this.pace}×`);
  }

  /** Say the pace again, to a server that has just begun. */
  renew(): void {
    if (this.pace !== 1) this.connection.send({ type: "pace", factor: this.pace });
  }

  key(event: KeyboardEvent): boolean {
    if (event.key === " ") this.toggle();
    else if (event.key === ".") this.step();
    else if (event.key === "Home") this.restart();
    else if (event.key === "[") this.faster(-1);
    else if (event.key === "]") this.faster(1);
    else return false;
    return true;
  }

  show(state: PlayerState): void {
    if (state.playing !== this.playing) {
      this.playing = state.playing;
      const word = this.playing ? "Pause" : "Play";
      replace(this.play, this.playing ? icons.pause() : icons.play());
      this.play.setAttribute("aria-label", word);
      this.play.title = `${word} (Space)`;
    }
    this.pace = state.pace;
    setText(this.paceText, `${state.pace}×`);
    this.line.min = String(state.first);
    this.line.max = String(Math.max(state.last, state.first + 0.01));
    if (!this.scrubbing) this.line.value = String(state.time);
    this.fill();
    setText(this.clock, `${state.time.toFixed(1)} s`);
    this.line.setAttribute("aria-valuetext", `${state.time.toFixed(1)} seconds`);
    const parts =
      state.mode === "scene" && (state.came || state.there) ? [`${state.there} there`, `${state.arrived} arrived`] : [];
    if (state.waiting) parts.push(`${state.waiting} waiting`);
    if (state.turned_away) parts.push(`${state.turned_away} without a way`);
    if (state.done && state.mode === "scene") parts.push("done");
    setText(this.counts, parts.join(" · "));
  }

  private fill(): void {
    const [low, high, value] = [this.line.min, this.line.max, this.line.value].map(Number) as [number, number, number];
    this.line.style.setProperty("--filled", `${high > low ? ((value - low) / (high - low)) * 100 : 0}%`);
  }
}
