/** Database mode: what was learned, segment by segment, and a database of one's own. */

import type { Frame } from "../../frames";
import type { ClipReady, DatabaseState, Welcome } from "../../protocol";
import { palette } from "../../stage/palette";
import { button, type Control, section, select, slider, toggle } from "../../ui/controls";
import { el, replace, setText } from "../../ui/dom";
import { exportButtons } from "../exports";
import type { Mode, Page } from "../mode";
import { Timeline } from "../scene/timeline";
import { colourOf, Scatter } from "./scatter";
import { Uploading } from "./uploading";

type SortKey = "status" | "speed" | "turn" | "style" | "seconds" | "take";

const COLUMNS: readonly { key: SortKey; label: string; title: string }[] = [
  { key: "status", label: "Motion", title: "Coarse motion and string of support states" },
  { key: "speed", label: "Speed", title: "m/s" },
  { key: "turn", label: "Turn", title: "rad/s" },
  { key: "style", label: "Mood", title: "gloomy -1 to brisk 1" },
  { key: "seconds", label: "Time", title: "s" },
  { key: "take", label: "Take", title: "Recording" },
];
const PAGE_OF = 120;

export class DatabaseMode implements Mode {
  readonly name = "database";
  readonly left = el("div", { class: "panel-body" });
  readonly right = el("div", { class: "panel-body" });
  readonly foot = el("div", { class: "foot-stack" });
  readonly help = [
    ["Tab, Enter", "go through the table, play a segment"],
    ["Click", "a dot or a row plays its clip beside the recording"],
    ["Space . Home", "play and pause, one frame, from the beginning"],
    ["[ ]", "slower, faster"],
    ["Drop files", "recordings (BVH, AMC with ASF, NPZ, C3D, GLB) to build a database of your own"],
    ["Right drag, Q E, wheel", "camera"],
  ] as const;

  private state: DatabaseState | null = null;
  private welcomed: Welcome | null = null;
  private active = false;
  private chosen = -1;
  private sort: SortKey = "speed";
  private descending = false;
  private shown = PAGE_OF;
  private kept: number[] = [];
  private readonly filter = { motion: "all", slowest: 0, fastest: 12, gloomiest: -1, briskest: 1, mirrored: true };
  private readonly wanted = { status: "walk", speed: 1.4, turn: 0, style: 0 };
  private readonly scatter = new Scatter(
    (example) => this.play(example),
    (example) => this.words(example),
  );
  private readonly rows = el("tbody");
  private readonly head = el("thead");
  private readonly tally = el("p", { class: "hint", role: "status" });
  private readonly more = button("Show more", () => this.showMore(), { kind: "quiet" });
  private readonly takes = el("div");
  private readonly told = el("div", { class: "clip-card", hidden: true });
  private readonly timeline: Timeline;
  private readonly uploading: Uploading;
  private readonly filters = el("div");
  private readonly asking = el("div");
  private lastTime = 0;
  private begins = true;
  private turning: { x: number; y: number; id: number } | null = null;

  constructor(private readonly page: Page) {
    this.timeline = new Timeline(page.connection);
    this.uploading = new Uploading(page);
    this.uploading.listen(document.documentElement, () => this.active);
    this.timeline.element.hidden = true;
    this.foot.append(this.told, this.timeline.element);
    this.left.append(
      section("Your recordings", {}, this.uploading.element),
      section("Ask for a motion", {}, this.asking),
      section("Show only", {}, this.filters),
      section(
        "Take it with you",
        {},
        exportButtons(page, [
          ["bvh", "BVH", "The clip that plays"],
          ["glb", "GLB", "The clip that plays"],
          ["database", "Database", "The database that was built"],
        ]),
      ),
    );
    const table = el(
      "div",
      { class: "table", tabindex: 0, role: "region", "aria-label": "Segments" },
      el("table", {}, this.head, this.rows),
      this.more,
    );
    this.right.append(
      el(
        "section",
        { class: "section" },
        el("h2", {}, "Segments"),
        this.scatter.element,
        this.legend(),
        this.tally,
        table,
      ),
      el("details", { class: "section" }, el("summary", {}, "Takes, and what was left out"), this.takes),
    );
    const { connection } = page;
    connection.on("database_state", (state) => this.learned(state));
    connection.on("clip_ready", (clip) => this.ready(clip));
    connection.on("player", (state) => {
      if (state.mode === "database") this.timeline.show(state);
    });
    this.mouse();
  }

  welcome(welcome: Welcome): void {
    this.welcomed = welcome;
    this.state = null;
    this.uploading.renew(welcome.database.built);
    this.timeline.renew();
    this.fillFilters(welcome);
    if (this.active) this.request();
  }

  enter(): void {
    this.active = true;
    const { stage, between } = this.page;
    between.clear();
    stage.shadowReach = 6;
    stage.setReach(60);
    stage.cameras.set("follow");
    if (!this.state) this.request();
    else if (this.chosen >= 0) this.play(this.chosen);
  }

  leave(): void {
    this.active = false;
    this.turning = null;
  }

  private request(): void {
    this.page.connection.send({ type: "database", request: this.page.connection.nextRequest() });
  }

  private learned(state: DatabaseState): void {
    this.state = state;
    this.chosen = -1;
    this.scatter.set(state.examples, this.motions);
    this.fillTakes(state);
    this.sieve();
    // something to see: a walk of usual speed, straight on
    const { speed, turn, clip, group } = state.examples;
    let best = -1;
    let least = Infinity;
    speed.forEach((v, i) => {
      const off = Math.abs(v - 1.35) + Math.abs(turn[i]!) + (this.motions[group[i]!] === "walk" ? 0 : 5);
      if (clip[i] && off < least) {
        least = off;
        best = i;
      }
    });
    if (best >= 0) this.play(best);
  }

  private get motions(): string[] {
    return this.welcomed?.database.groups.map((group) => group.motion) ?? [];
  }

  private words(example: number): string {
    const columns = this.state!.examples;
    const group = this.welcomed!.database.groups[columns.group[example]!];
    return `${group?.name ?? ""} · ${columns.speed[example]!.toFixed(2)} m/s · ${plain(columns.turn[example]!)} rad/s`;
  }

  private play(example: number): void {
    this.chosen = example;
    this.begins = true;
    this.page.between.clear();
    this.page.connection.send({ type: "clip", example, request: this.page.connection.nextRequest() });
    this.drawRows();
  }

  private ready(clip: ClipReady): void {
    const source = clip.mix.length === 1 ? "one recording" : `${clip.mix.length} recordings`;
    this.told.hidden = false;
    this.timeline.element.hidden = false;
    replace(
      this.told,
      el(
        "p",
        {},
        el("strong", {}, clip.status.replace("-", " to ")),
        ` ${clip.speed.toFixed(2)} m/s, turning ${plain(clip.turn)} rad/s, mood ${plain(clip.style)}, ${clip.seconds.toFixed(1)} s`,
      ),
      el(
        "p",
        { class: "keyline" },
        el("span", { class: "swatch dot body" }),
        clip.recorded ? "the clip, as recorded" : `the clip, blended of ${source}`,
        clip.beside && el("span", { class: "swatch dot beside" }),
        clip.beside && "the segment in its recording",
      ),
      ...clip.warnings.map((warning) => el("p", { class: "warning" }, warning)),
    );
    this.page.connection.send({ type: "playback", action: "play" });
  }

  frame(frame: Frame): void {
    if (frame.time < this.lastTime) this.begins = true; // the clip begins again, and the camera is there at once
    this.lastTime = frame.time;
  }

  tick(_seconds: number, now: number): void {
    const { stage, between, people } = this.page;
    between.sample(now);
    const frame = between.newest;
    if (!people) return;
    if (!frame || frame.kind !== 3) {
      people.show([], stage.camera.position);
      return;
    }
    const everybody = Array.from({ length: frame.count }, (_, i) => ({
      x: between.places[3 * i]!,
      z: between.places[3 * i + 1]!,
      heading: between.places[3 * i + 2]!,
      scale: 1,
      colour: frame.ids[i] === 1 ? palette.body : 0x9db2f2,
      roots: i < frame.full ? between.roots : null,
      rotations: i < frame.full ? between.rotations : null,
      rootAt: 3 * i,
      rotationAt: 4 * frame.joints * i,
    }));
    people.show(everybody, stage.camera.position);
    const middle = everybody.reduce(
      (sum, { x, z }) => [sum[0] + x / everybody.length, sum[1] + z / everybody.length] as [number, number],
      [0, 0] as [number, number],
    );
    stage.cameras.follow(middle[0], 0.8, middle[1]);
    if (this.begins) stage.cameras.jump();
    this.begins = false;
  }

  key(event: KeyboardEvent): boolean {
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    return this.timeline.key(event);
  }

  private mouse(): void {
    const { stage } = this.page;
    stage.canvas.addEventListener("pointerdown", (event) => {
      if (!this.active) return;
      this.turning = { x: event.clientX, y: event.clientY, id: event.pointerId };
      stage.canvas.setPointerCapture(event.pointerId);
    });
    stage.canvas.addEventListener("pointermove", (event) => {
      if (!this.active || this.turning?.id !== event.pointerId) return;
      stage.cameras.rotate((event.clientX - this.turning.x) * 0.006, (event.clientY - this.turning.y) * 0.006);
      Object.assign(this.turning, { x: event.clientX, y: event.clientY });
    });
    addEventListener("pointerup", () => (this.turning = null));
    stage.canvas.addEventListener("contextmenu", (event) => this.active && event.preventDefault());
  }

  // filters, table, takes

  private sieve(): void {
    const { state, filter } = this;
    if (!state) return;
    const { speed, style, group, mirrored } = state.examples;
    const motions = this.motions;
    this.kept = [];
    for (let i = 0; i < speed.length; i++) {
      const motion = motions[group[i]!] ?? "";
      if (filter.motion === "between" ? !motion.includes("-") : filter.motion !== "all" && motion !== filter.motion)
        continue;
      if (
        speed[i]! < filter.slowest ||
        speed[i]! > filter.fastest ||
        style[i]! < filter.gloomiest ||
        style[i]! > filter.briskest
      )
        continue;
      if (!filter.mirrored && mirrored[i]) continue;
      this.kept.push(i);
    }
    this.shown = PAGE_OF;
    this.order();
    this.drawRows();
  }

  private order(): void {
    const columns = this.state!.examples;
    const groups = this.welcomed!.database.groups;
    const value = (i: number): number | string => {
      if (this.sort === "status") return groups[columns.group[i]!]?.name ?? "";
      if (this.sort === "take") return this.state!.takes[columns.take[i]!]?.name ?? "";
      return columns[this.sort][i]!;
    };
    const way = this.descending ? -1 : 1;
    this.kept.sort((a, b) => {
      const [x, y] = [value(a), value(b)];
      return (x < y ? -1 : x > y ? 1 : a - b) * way;
    });
  }

  private drawRows(): void {
    const { state } = this;
    if (!state) return;
    const columns = state.examples;
    const groups = this.welcomed!.database.groups;
    this.scatter.show(new Set(this.kept), this.chosen);
    setText(this.tally, `${this.kept.length} of ${columns.speed.length} segments`);
    replace(
      this.head,
      el(
        "tr",
        {},
        ...COLUMNS.map(({ key, label, title }) => {
          const sorted = key === this.sort;
          const node = el(
            "button",
            { type: "button", class: "sort", title: `${title}; press to sort` },
            label,
            sorted && el("span", { "aria-hidden": "true" }, this.descending ? " ↓" : " ↑"),
          );
          node.addEventListener("click", () => {
            this.descending = sorted && !this.descending;
            this.sort = key;
            this.order();
            this.drawRows();
            (
              this.head.querySelectorAll("button")[COLUMNS.findIndex((column) => column.key === key)] as
                HTMLElement | undefined
            )?.focus();
          });
          return el(
            "th",
            { scope: "col", "aria-sort": sorted ? (this.descending ? "descending" : "ascending") : undefined },
            node,
          );
        }),
      ),
    );
    const focused = this.rows.contains(document.activeElement);
    replace(
      this.rows,
      ...this.kept.slice(0, this.shown).map((i) => {
        const group = groups[columns.group[i]!];
        const swatch = el("span", { class: "swatch dot" });
        swatch.style.background = colourOf(group?.motion ?? "");
        const row = el(
          "tr",
          {
            role: "row",
            tabindex: 0,
            "aria-selected": String(i === this.chosen),
            class: i === this.chosen ? "chosen" : "",
          },
          el("td", {}, swatch, group?.name ?? ""),
          ...[columns.speed[i]!, columns.turn[i]!, columns.style[i]!, columns.seconds[i]!].map((value) =>
            el("td", { class: "figure" }, plain(value)),
          ),
          el(
            "td",
            { class: "take", title: state.takes[columns.take[i]!]?.name },
            `${state.takes[columns.take[i]!]?.name ?? ""}${columns.mirrored[i] ? " ⇄" : ""}`,
          ),
        );
        row.addEventListener("click", () => this.play(i));
        row.addEventListener("keydown", (event) => {
          if (event.key === "Enter" || event.key === " ") {
            event.preventDefault();
            this.play(i);
          } else if (event.key === "ArrowDown") (row.nextElementSibling as HTMLElement | null)?.focus();
          else if (event.key === "ArrowUp") (row.previousElementSibling as HTMLElement | null)?.focus();
          else return;
          event.stopPropagation();
          event.preventDefault();
        });
        return row;
      }),
    );
    this.more.hidden = this.kept.length <= this.shown;
    if (focused) (this.rows.querySelector(".chosen") as HTMLElement | null)?.focus();
  }

  private showMore(): void {
    this.shown += PAGE_OF;
    this.drawRows();
  }

  private fillTakes(state: DatabaseState): void {
    const left = state.takes.filter((take) => take.left_out.length > 0);
    const used = state.takes.length - left.length;
    replace(
      this.takes,
      el(
        "p",
        { class: "hint" },
        left.length
          ? `${used} of ${state.takes.length} takes are used whole; of the others:`
          : `All ${state.takes.length} takes are used.`,
      ),
      el(
        "ul",
        { class: "takes" },
        ...[...left, ...state.takes.filter((take) => take.left_out.length === 0)].map((take) =>
          el(
            "li",
            {},
            el("span", { class: "take-name" }, take.name),
            el(
              "span",
              { class: "take-facts" },
              `${take.seconds.toFixed(1)} s · ${take.segments} segments${take.statuses.length ? ` · ${take.statuses.join(", ")}` : ""}`,
            ),
            ...[...take.left_out, ...take.notes].map((why) => el("span", { class: "take-why" }, why)),
          ),
        ),
      ),
    );
  }

  private legend(): HTMLElement {
    const entry = (motion: string, label: string): HTMLElement => {
      const swatch = el("span", { class: "swatch dot" });
      swatch.style.background = colourOf(motion);
      return el("span", {}, swatch, label);
    };
    return el(
      "p",
      { class: "motion-key" },
      entry("stand", "stand"),
      entry("walk", "walk"),
      entry("run", "run"),
      entry("-", "in between"),
    );
  }

  private fillFilters(welcome: Welcome): void {
    const { filter, wanted } = this;
    const { database } = welcome;
    const motions = [...new Set(database.groups.map((group) => group.motion))];
    const top = Math.ceil(Math.max(2, ...Object.values(database.top_speeds)) * 2) / 2 + 1;
    filter.fastest = Math.min(filter.fastest, top);
    const bound = (
      label: string,
      key: "slowest" | "fastest" | "gloomiest" | "briskest",
      min: number,
      max: number,
      unit: string,
    ): Control<number> =>
      slider({
        label,
        min,
        max,
        step: 0.05,
        value: filter[key] > max ? max : filter[key],
        format: (value) => `${value.toFixed(2)}${unit}`,
        onInput: (value) => ((filter[key] = value), this.sieve()),
      });
    replace(
      this.filters,
      select(
        "Motion",
        [
          { value: "all", label: "all" },
          ...motions.filter((motion) => !motion.includes("-")).map((motion) => ({ value: motion, label: motion })),
          { value: "between", label: "in between" },
        ],
        filter.motion,
        (motion) => ((filter.motion = motion), this.sieve()),
      ).element,
      bound("Not slower than", "slowest", 0, top, " m/s").element,
      bound("Not faster than", "fastest", 0, top, " m/s").element,
      bound("Not gloomier than", "gloomiest", -1, 1, "").element,
      bound("Not brisker than", "briskest", -1, 1, "").element,
      toggle("Mirrored ones too", filter.mirrored, (on) => ((filter.mirrored = on), this.sieve())).element,
    );
    const ask = (label: string, key: "speed" | "turn" | "style", min: number, max: number, unit: string): HTMLElement =>
      slider({
        label,
        min,
        max,
        step: 0.05,
        value: wanted[key],
        format: (value) => `${value.toFixed(2)}${unit}`,
        onInput: (value) => (wanted[key] = value),
      }).element;
    replace(
      this.asking,
      select(
        "Motion",
        database.motions.map((motion) => ({ value: motion as string, label: motion })),
        wanted.status,
        (status) => (wanted.status = status),
      ).element,
      ask("Speed", "speed", 0, top, " m/s"),
      ask("Turn", "turn", -2, 2, " rad/s"),
      ask("Mood", "style", -1, 1, ""),
      el(
        "div",
        { class: "button-row" },
        button("Find and play", () => this.mine(), { kind: "primary" }),
      ),
    );
  }

  private mine(): void {
    const { status, speed, turn, style } = this.wanted;
    this.chosen = -1;
    this.page.between.clear();
    this.page.connection.send({
      type: "mine",
      status,
      ...(status === "stand" ? {} : { speed, turn }),
      style,
      request: this.page.connection.nextRequest(),
    });
    this.drawRows();
  }
}

/** Two decimals, and no minus before nought. */
const plain = (value: number): string => (Math.abs(value) < 0.005 ? 0 : value).toFixed(2);
