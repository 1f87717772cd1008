/** Scene mode: draw a place, put people into it, let them go, and see why they do what they do. */

import type { Frame } from "../../frames";
import type { Shown } from "../../figures/people";
import type { ScenePart, Somebody, Welcome } from "../../protocol";
import type { View } from "../../stage/cameras";
import { crowdColours, palette } from "../../stage/palette";
import type { Spot } from "../../stage/stage";
import { button, iconButton, section, segmented } from "../../ui/controls";
import { el, replace, setText } from "../../ui/dom";
import { icons } from "../../ui/icons";
import type { PictureOptions } from "../../ui/options";
import { exportButtons, saveText } from "../exports";
import type { Mode, Page } from "../mode";
import { Asking } from "./asking";
import {
  allOf,
  EMPTY,
  extent,
  type Handle,
  handlesOf,
  listOf,
  moveBy,
  moveHandle,
  nameOf,
  partOf,
  type Ref,
  remove,
  same,
  thingAt,
} from "./document";
import { SceneDrawing } from "./drawing";
import { Finding } from "./finding";
import { History } from "./history";
import { inspector } from "./inspector";
import { personAt } from "./picking";
import { crossing, square } from "./starter";
import { Timeline } from "./timeline";
import { Drawing, HINTS, type Tool } from "./tools";

const TOOLS: readonly { tool: Tool; label: string; key: string }[] = [
  { tool: "select", label: "Choose", key: "V" },
  { tool: "road", label: "Road", key: "R" },
  { tool: "circle", label: "Circle", key: "C" },
  { tool: "polygon", label: "Polygon", key: "P" },
  { tool: "wall", label: "Wall", key: "W" },
  { tool: "person", label: "Person", key: "A" },
  { tool: "source", label: "Source", key: "S" },
  { tool: "start", label: "Start", key: "B" },
  { tool: "goal", label: "Goal", key: "G" },
];

const SEND_AFTER = 140;
const LOOK_EVERY = 250;

type Drag =
  | { what: "view"; x: number; y: number; id: number; turn: boolean; moved: boolean }
  | { what: "things"; from: Spot; scene: ScenePart; refs: readonly Ref[]; id: number; moved: boolean; run: string }
  | { what: "handle"; handle: Handle; ref: Ref; id: number; run: string }
  | { what: "draw"; id: number };

export class SceneMode implements Mode {
  readonly name = "scene";
  readonly left = el("div", { class: "panel-body" });
  readonly right = el("div", { class: "panel-body" });
  readonly foot = el("div", { class: "foot-stack" });
  readonly help = [
    ["V R C P W A S B G", "tools: choose, road, circle, polygon, wall, person, source, start, goal"],
    ["Click, shift-click", "choose one, choose more; drag to move"],
    ["Drag the ground", "shift the view; right drag or Q E: turn it; wheel: nearer, farther"],
    ["Arrows", "move the mark on the ground (with shift a metre), or the chosen things"],
    ["Enter", "click at the mark; end a line"],
    ["Backspace", "take the last point back"],
    ["Delete", "delete what is chosen"],
    ["Ctrl Z, Ctrl Y", "undo, redo"],
    ["Space . Home", "play and pause, one frame, from the beginning"],
    ["[ ]", "slower, faster"],
    ["F O T 0", "camera: follow whom you asked about, orbit, top, all of it"],
    ["Esc", "let go"],
  ] as const;

  private readonly history = new History<ScenePart>(EMPTY);
  private begun = false;
  private chosen: Ref[] = [];
  private tool: Tool = "select";
  private active = false;
  private drag: Drag | null = null;
  private cursor: Spot | null = null;
  private readonly people = new Map<number, Somebody>();
  private readonly drawing = new SceneDrawing();
  private readonly asking: Asking;
  private readonly hands: Drawing;
  private readonly timeline: Timeline;
  private readonly hint = el("p", { class: "hint-text", role: "status" }, HINTS.select);
  private readonly problem = el("p", { class: "problem", role: "alert" });
  private readonly list = el("ul", { class: "things" });
  private readonly inspected = el("div");
  private readonly count = el("span", { class: "count" });
  private readonly toolButtons = new Map<Tool, HTMLButtonElement>();
  private readonly undoButton = iconButton("Undo", icons.undo, () => this.undo(), "Ctrl Z");
  private readonly redoButton = iconButton("Redo", icons.redo, () => this.redo(), "Ctrl Y");
  private readonly view;
  private sendTimer: ReturnType<typeof setTimeout> | undefined;
  private lookedAt = 0;
  private looked = "";
  private placed = false;

  constructor(
    private readonly page: Page,
    private readonly options: PictureOptions,
  ) {
    this.hands = new Drawing({
      scene: () => this.scene,
      chosen: () => this.chosen,
      change: (scene, chosen) => this.change(scene, null, chosen),
      draft: (draft) => this.drawing.sketch(draft?.points ?? [], draft ?? {}),
      say: (text) => this.page.messages.say(text),
    });
    this.asking = new Asking(page.connection);
    this.timeline = new Timeline(page.connection, () => this.sendWaiting());
    this.foot.append(new Finding(page.connection).element, this.problem, this.hint, this.timeline.element);
    this.problem.hidden = true;
    this.view = segmented<View>(
      "Camera",
      [
        { value: "follow", label: "Follow", icon: icons.follow, title: "Key F: follow whom you asked about" },
        { value: "orbit", label: "Orbit", icon: icons.orbit, title: "Key O" },
        { value: "top", label: "Top", icon: icons.top, title: "Key T" },
      ],
      "orbit",
      (view) => this.page.stage.cameras.set(view, true),
    );
    this.fill();
    this.listen();
    this.mouse();
  }

  private get scene(): ScenePart {
    return this.history.present;
  }

  private listen(): void {
    const { connection, messages } = this.page;
    connection.on("player", (state) => {
      if (state.mode !== "scene") return;
      const [played, began] = [this.timeline.playing, this.atStart];
      this.timeline.show(state);
      this.atStart = state.time < 0.02 && !state.playing;
      this.hint.hidden = state.playing && this.tool === "select";
      if (played !== this.timeline.playing || began !== this.atStart) this.redraw(true);
    });
    connection.on("people", ({ begins, people, movers }) => {
      if (begins) this.people.clear();
      for (const somebody of people) this.people.set(somebody.id, somebody);
      if (begins) this.drawing.setMovers(movers);
    });
    connection.on("scene_checked", ({ applied, message, place, anew }) => {
      this.problem.hidden = applied !== "refused" && applied !== "cancelled";
      if (applied === "refused") setText(this.problem, place ? `${place}: ${message}` : message);
      if (applied === "cancelled")
        setText(this.problem, "Given up: what walks is as it was. Undo, or change something to try again.");
      if (applied === "restarted" || applied === "empty") this.page.between.clear();
      if (applied === "restarted") {
        this.asking.ask(null);
        if (message) messages.say(`The scene has begun anew: ${message}.`);
      }
      if (anew.length) messages.say(`${listed(anew)} ${anew.length > 1 ? "begin" : "begins"} anew; all others go on.`);
    });
    connection.on("scene_opened", ({ scene }) => {
      this.open(scene);
      messages.say("The scene is open.", "good");
    });
    connection.on("scene_saved", ({ text }) => {
      saveText("scene.yaml", text, "application/yaml");
      messages.say("scene.yaml is being saved.", "good");
    });
  }

  private atStart = true;

  welcome(welcome: Welcome): void {
    this.people.clear();
    this.timeline.renew();
    if (!this.begun) {
      this.begun = true;
      const given = allOf(welcome.scene).length > 0 || welcome.scene.start;
      this.history.push(given ? welcome.scene : crossing);
      this.redraw();
    }
    this.sendScene();
    this.looked = "";
    if (this.asking.who !== null) this.asking.ask(null);
  }

  enter(): void {
    this.active = true;
    const { stage, between } = this.page;
    between.clear();
    stage.scene.add(this.drawing.group, ...this.asking.meshes);
    stage.setReach(260);
    stage.cameras.set(this.view.get());
    if (!this.placed) this.fit(true);
    this.redraw();
    this.looked = "";
  }

  leave(): void {
    this.active = false;
    this.hands.cancel();
    this.drag = null;
    this.page.stage.scene.remove(this.drawing.group, ...this.asking.meshes);
  }

  // the document

  private change(scene: ScenePart, run: string | null, chosen: readonly Ref[] = this.chosen): void {
    this.history.push(scene, run);
    this.chosen = chosen.filter((ref) => partOf(scene, ref) !== undefined);
    this.redraw(run !== null && this.inspected.contains(document.activeElement));
    this.later();
  }

  private undo(): void {
    if (this.history.undo()) this.restored();
  }

  private redo(): void {
    if (this.history.redo()) this.restored();
  }

  private restored(): void {
    this.chosen = this.chosen.filter((ref) => partOf(this.scene, ref) !== undefined);
    this.hands.cancel();
    this.redraw();
    this.later();
  }

  private later(): void {
    clearTimeout(this.sendTimer);
    this.sendTimer = setTimeout(() => this.sendScene(), SEND_AFTER);
  }

  /** Send what has been edited a moment ago at once. */
  private sendWaiting(): void {
    if (this.sendTimer !== undefined) this.sendScene();
  }

  private sendScene(): void {
    clearTimeout(this.sendTimer);
    this.sendTimer = undefined;
    this.page.connection.send({ type: "scene", scene: this.scene, request: this.page.connection.nextRequest() });
  }

  private open(scene: ScenePart): void {
    this.history.push(scene);
    this.chosen = [];
    this.asking.ask(null);
    this.redraw();
    this.sendScene();
    this.fit();
  }

  private choose(refs: readonly Ref[]): void {
    this.chosen = [...refs];
    this.history.seal();
    this.redraw();
  }

  private removeChosen(): void {
    if (this.chosen.length) this.change(remove(this.scene, this.chosen), null, []);
  }

  /** Bring the picture and the panels up to date; `quiet` leaves the inspector, in which somebody is busy. */
  private redraw(quiet = false): void {
    this.drawing.show(this.scene, this.chosen, !this.timeline.playing);
    this.undoButton.disabled = !this.history.canUndo;
    this.redoButton.disabled = !this.history.canRedo;
    if (!quiet) {
      replace(
        this.inspected,
        inspector(() => this.scene, this.chosen, {
          change: (scene, run) => this.change(scene, run),
          remove: () => this.removeChosen(),
        }),
      );
    }
    const all = allOf(this.scene);
    setText(this.count, String(all.length));
    const focused = this.list.contains(document.activeElement);
    replace(
      this.list,
      ...all.map((ref) => {
        const chosen = this.chosen.some((other) => same(other, ref));
        const item = el(
          "button",
          { type: "button", class: "thing", "aria-pressed": String(chosen) },
          glyphOf(this.scene, ref)(),
          el("span", { class: "text" }, nameOf(this.scene, ref)),
        );
        item.addEventListener("click", (event) =>
          this.choose(event.shiftKey || event.ctrlKey ? toggled(this.chosen, ref) : [ref]),
        );
        return el("li", {}, item);
      }),
    );
    const first = this.list.querySelector<HTMLElement>("[aria-pressed=true]");
    if (focused) first?.focus();
    first?.scrollIntoView({ block: "nearest" });
  }

  // frames and pictures

  frame(frame: Frame): void {
    this.drawing.moveMovers(frame.movers);
  }

  tick(_seconds: number, now: number): void {
    const { stage, between, people } = this.page;
    between.sample(now);
    const frame = between.newest;
    if (people) people.show(frame && frame.kind === 2 ? this.shown(frame) : [], stage.camera.position);
    const distance = stage.cameras.eye.distance;
    stage.shadowReach = Math.min(40, Math.max(7, distance * 0.85));
    this.asking.update();
    if (now - this.lookedAt > LOOK_EVERY) {
      this.lookedAt = now;
      this.look();
    }
  }

  private *shown(frame: Frame): Generator<Shown> {
    const { between } = this.page;
    for (let i = 0; i < frame.count; i++) {
      const id = frame.ids[i]!;
      const x = between.places[3 * i]!;
      const z = between.places[3 * i + 1]!;
      const full = i < frame.full;
      if (id === this.asking.who) this.page.stage.cameras.follow(x, 0.8, z);
      yield {
        x,
        z,
        heading: between.places[3 * i + 2]!,
        scale: this.people.get(id)?.scale ?? 1,
        colour: id === this.asking.who ? palette.chosen : crowdColours[id % crowdColours.length]!,
        roots: full ? between.roots : null,
        rotations: full ? between.rotations : null,
        rootAt: 3 * i,
        rotationAt: 4 * frame.joints * i,
      };
    }
  }

  /** Tell the server where we look, so that the nearest come with poses. */
  look(): void {
    if (!this.active) return;
    const { cameras, camera } = this.page.stage;
    // nearer to the eye than what is looked at: those are seen large
    const x = cameras.target.x * 0.75 + camera.position.x * 0.25;
    const z = cameras.target.z * 0.75 + camera.position.z * 0.25;
    const message = {
      type: "view",
      center: [Math.round(x * 4) / 4, Math.round(z * 4) / 4] as [number, number],
      radius: Math.round(Math.max(15, cameras.eye.distance * 1.6)),
      full: this.options.poses,
    } as const;
    const words = JSON.stringify(message);
    if (words === this.looked) return;
    if (this.page.connection.send(message)) this.looked = words;
  }

  private fit(jump = false): void {
    const box = extent(this.scene);
    const { cameras } = this.page.stage;
    this.placed = true;
    const [x0, z0, x1, z1] = box ?? [-5, -5, 5, 5];
    const { clientWidth, clientHeight } = this.page.stage.canvas;
    const tall = Math.max(1, clientHeight / Math.max(1, clientWidth));
    cameras.lookAt((x0 + x1) / 2, (z0 + z1) / 2, Math.max(9, Math.hypot(x1 - x0, z1 - z0) * 1.02 * tall));
    if (jump) cameras.jump();
  }

  // mouse

  private mouse(): void {
    const { stage } = this.page;
    const { canvas } = stage;
    canvas.addEventListener("pointerdown", (event) => this.active && this.pressed(event));
    canvas.addEventListener("pointermove", (event) => this.active && this.moved(event));
    addEventListener("pointerup", (event) => this.active && this.released(event));
    canvas.addEventListener("dblclick", () => this.active && this.hands.finish(this.tool));
    canvas.addEventListener("contextmenu", (event) => this.active && event.preventDefault());
    canvas.addEventListener("dragover", (event) => this.active && event.preventDefault());
    canvas.addEventListener("drop", (event) => {
      const file = event.dataTransfer?.files[0];
      if (!this.active || !file) return;
      event.preventDefault();
      void this.read(file);
    });
  }

  private get reach(): number {
    return Math.max(0.15, this.page.stage.cameras.eye.distance * 0.018);
  }

  private pressed(event: PointerEvent): void {
    const { stage } = this.page;
    stage.canvas.focus({ preventScroll: true });
    stage.canvas.setPointerCapture(event.pointerId);
    const id = event.pointerId;
    this.cursor = null;
    this.drawing.showCursor(null);
    if (event.button !== 0) {
      this.drag = { what: "view", x: event.clientX, y: event.clientY, id, turn: event.button === 2, moved: false };
      return;
    }
    const spot = stage.spotAt(event.clientX, event.clientY);
    if (!spot) return;
    if (this.tool !== "select") {
      this.hands.press(spot);
      this.drag = { what: "draw", id };
      return;
    }
    const run = `drag ${performance.now()}`;
    const only = this.chosen.length === 1 ? this.chosen[0] : undefined;
    const handle =
      only &&
      handlesOf(this.scene, only).find((found) => Math.hypot(found.x - spot.x, found.z - spot.z) < this.reach * 1.3);
    if (only && handle) {
      this.drag = { what: "handle", handle, ref: only, id, run };
      return;
    }
    const walking = personAt(stage, this.page.between, event.clientX, event.clientY);
    if (walking !== null) {
      this.asking.ask(walking);
      const name = this.people.get(walking)?.name;
      const index = listOf(this.scene, "people").findIndex((person) => person.name === name);
      const ref: Ref | null = index >= 0 ? { kind: "people", index } : null;
      if (ref) {
        this.choose(event.shiftKey ? toggled(this.chosen, ref) : [ref]);
        if (this.atStart)
          this.drag = { what: "things", from: spot, scene: this.scene, refs: this.chosen, id, moved: false, run };
      } else this.choose([]);
      return;
    }
    const found = thingAt(this.scene, spot.x, spot.z, this.reach);
    if (found && (found.kind !== "roads" || this.chosen.some((ref) => same(ref, found)))) {
      if (event.shiftKey) this.choose(toggled(this.chosen, found));
      else if (!this.chosen.some((ref) => same(ref, found))) this.choose([found]);
      this.drag = { what: "things", from: spot, scene: this.scene, refs: this.chosen, id, moved: false, run };
      return;
    }
    // roads are wide: a click chooses one, a drag shifts the view
    this.drag = { what: "view", x: event.clientX, y: event.clientY, id, turn: false, moved: false };
  }

  private moved(event: PointerEvent): void {
    const { stage } = this.page;
    const spot = stage.spotAt(event.clientX, event.clientY);
    const { drag } = this;
    if (drag?.what === "view") {
      const dx = event.clientX - drag.x;
      const dy = event.clientY - drag.y;
      if (!drag.moved && Math.hypot(dx, dy) < 4) return;
      Object.assign(drag, { x: event.clientX, y: event.clientY, moved: true });
      if (drag.turn) stage.cameras.rotate(dx * 0.006, dy * 0.006);
      else stage.cameras.pan(-dx / stage.canvas.clientHeight, dy / stage.canvas.clientHeight);
      return;
    }
    if (!spot) return;
    if (drag?.what === "handle") this.change(moveHandle(this.scene, drag.ref, drag.handle, spot.x, spot.z), drag.run);
    else if (drag?.what === "things") {
      const [dx, dz] = [spot.x - drag.from.x, spot.z - drag.from.z];
      if (!drag.moved && Math.hypot(dx, dz) < this.reach * 0.6) return;
      drag.moved = true;
      this.change(
        drag.refs.reduce((scene, ref) => moveBy(scene, ref, dx, dz), drag.scene),
        drag.run,
        drag.refs,
      );
    } else if (this.tool !== "select") this.hands.move(this.tool, spot);
  }

  private released(event: PointerEvent): void {
    const { drag } = this;
    if (!drag || drag.id !== event.pointerId) return;
    this.drag = null;
    const spot = this.page.stage.spotAt(event.clientX, event.clientY);
    if (drag.what === "draw" && spot) this.hands.release(this.tool, spot, event.shiftKey);
    if (drag.what === "view" && !drag.moved && !drag.turn && spot) {
      const found = thingAt(this.scene, spot.x, spot.z, this.reach);
      if (found) this.choose(event.shiftKey ? toggled(this.chosen, found) : [found]);
      else if (!event.shiftKey) {
        this.choose([]);
        this.asking.ask(null);
      }
    }
    this.history.seal();
  }

  // keys

  key(event: KeyboardEvent): boolean {
    const ctrl = event.ctrlKey || event.metaKey;
    const key = event.key.toLowerCase();
    if (ctrl) {
      if (key === "z" && !event.shiftKey) this.undo();
      else if (key === "y" || key === "z") this.redo();
      else if (key === "s") this.save();
      else if (key === "a") this.choose(allOf(this.scene).filter((ref) => ref.kind === "people"));
      else return false;
      return true;
    }
    if (event.altKey) return false;
    if (this.timeline.key(event)) return true;
    const tool = TOOLS.find((each) => each.key.toLowerCase() === key);
    const views: Record<string, View> = { f: "follow", o: "orbit", t: "top" };
    if (tool) this.take(tool.tool);
    else if (views[key]) {
      this.view.set(views[key]);
      this.page.stage.cameras.set(views[key], true);
    } else if (key === "0") this.fit();
    else if (key === "delete") this.removeChosen();
    else if (key === "backspace") this.hands.back() || this.removeChosen();
    else if (key === "escape") this.letGo();
    else if (event.key.startsWith("Arrow")) this.arrow(event.key, event.shiftKey);
    else if (key === "enter") this.enterKey(event.shiftKey);
    else return false;
    return true;
  }

  private letGo(): void {
    if (this.hands.drawing) this.hands.cancel();
    else if (this.tool !== "select") this.take("select");
    else {
      this.choose([]);
      this.asking.ask(null);
    }
    this.cursor = null;
    this.drawing.showCursor(null);
  }

  private arrow(key: string, far: boolean): void {
    const { cameras } = this.page.stage;
    const step = far ? 1 : 0.25;
    // to the nearest of the axes, as seen
    const quarter = Math.round(cameras.ahead / (Math.PI / 2)) * (Math.PI / 2);
    const [right, up] = (
      { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] } as Record<
        string,
        [number, number]
      >
    )[key]!;
    const dx = (Math.sin(quarter) * up - Math.cos(quarter) * right) * step;
    const dz = (Math.cos(quarter) * up + Math.sin(quarter) * right) * step;
    if (this.tool === "select" && this.chosen.length) {
      this.change(
        this.chosen.reduce((scene, ref) => moveBy(scene, ref, dx, dz), this.scene),
        "arrows",
      );
      return;
    }
    const at = this.cursor ?? { x: Math.round(cameras.target.x * 4) / 4, z: Math.round(cameras.target.z * 4) / 4 };
    this.cursor = { x: at.x + dx, z: at.z + dz };
    this.drawing.showCursor(this.cursor);
    if (this.tool !== "select") this.hands.move(this.tool, this.cursor);
    setText(this.hint, `Mark at ${this.cursor.x.toFixed(2)}, ${this.cursor.z.toFixed(2)} m. Enter clicks there.`);
  }

  private enterKey(more: boolean): void {
    const { cursor } = this;
    if (!cursor) {
      this.hands.finish(this.tool);
      return;
    }
    if (this.tool === "select") {
      const found = thingAt(this.scene, cursor.x, cursor.z, 0.4);
      this.choose(found ? (more ? toggled(this.chosen, found) : [found]) : []);
      return;
    }
    this.hands.press(cursor);
    this.hands.release(this.tool, cursor, more);
  }

  private take(tool: Tool): void {
    this.tool = tool;
    this.hands.cancel();
    for (const [name, node] of this.toolButtons) node.setAttribute("aria-pressed", String(name === tool));
    setText(this.hint, HINTS[tool]);
    this.hint.hidden = this.timeline.playing && tool === "select";
  }

  // panels and files

  private save(): void {
    const { connection } = this.page;
    if (!connection.send({ type: "save_scene", scene: this.scene, request: connection.nextRequest() })) {
      this.page.messages.error(
        "There is no connection to the server, which writes the file. Wait until it is back, then save again.",
      );
    }
  }

  private async read(file: File): Promise<void> {
    const { connection, messages } = this.page;
    if (file.size > 2 * 2 ** 20)
      messages.error(`${file.name} has ${(file.size / 2 ** 20).toFixed(1)} MB. Scenes have 2 MB at most.`);
    else if (!connection.send({ type: "open_scene", text: await file.text(), request: connection.nextRequest() }))
      messages.error(
        "There is no connection to the server, which reads the file. Wait until it is back, then open it again.",
      );
  }

  private fill(): void {
    const tools = el("div", { class: "tools", role: "group", "aria-label": "Tools" });
    for (const { tool, label, key } of TOOLS) {
      const node = button(label, () => this.take(tool), { icon: icons[tool], title: `${label} (${key})`, key });
      node.classList.add("tool");
      node.setAttribute("aria-pressed", String(tool === this.tool));
      this.toolButtons.set(tool, node);
      tools.append(node);
    }
    const file = el("input", {
      type: "file",
      accept: ".yaml,.yml,application/yaml",
      class: "visually-hidden",
      "aria-label": "Scene file",
      tabindex: -1,
    });
    file.addEventListener("change", () => {
      const picked = file.files?.[0];
      if (picked) void this.read(picked);
      file.value = "";
    });
    this.left.append(
      section(
        "Draw",
        {},
        tools,
        el(
          "div",
          { class: "button-row" },
          this.undoButton,
          this.redoButton,
          button("See all of it", () => this.fit(), { icon: icons.fit, key: "0" }),
        ),
      ),
      section("See", {}, this.view.element),
      el("section", { class: "section" }, el("h2", {}, "In the scene ", this.count), this.list),
      section(
        "Scene",
        {},
        el(
          "div",
          { class: "button-row" },
          button("Open", () => file.click(), { icon: icons.open, title: "Open a scene file (YAML)" }),
          button("Save", () => this.save(), { icon: icons.save, title: "Save as a scene file (Ctrl S)" }),
          button("New", () => this.open(EMPTY), { title: "Begin with empty ground; undo brings this one back" }),
        ),
        file,
        el(
          "div",
          { class: "button-row" },
          button("Crossing", () => this.open(crossing), { kind: "quiet" }),
          button("Busy square", () => this.open(square), { kind: "quiet" }),
        ),
      ),
      section(
        "Take it with you",
        {},
        exportButtons(this.page, [
          ["bvh", "BVH", "The motion of everybody, a file each"],
          ["glb", "GLB", "Everybody in motion, for viewers and engines"],
          ["csv", "CSV", "Everybody's way"],
        ]),
      ),
    );
    this.right.append(this.asking.element, this.inspected);
  }
}

function listed(names: readonly string[]): string {
  const shown = names.length > 4 ? [...names.slice(0, 3), `${names.length - 3} more`] : names;
  return shown.length > 1 ? `${shown.slice(0, -1).join(", ")} and ${shown.at(-1)}` : (shown[0] ?? "");
}

function toggled(refs: readonly Ref[], ref: Ref): Ref[] {
  return refs.some((other) => same(other, ref)) ? refs.filter((other) => !same(other, ref)) : [...refs, ref];
}

function glyphOf(scene: ScenePart, ref: Ref): () => Node {
  if (ref.kind === "obstacles") return "center" in (partOf(scene, ref) ?? {}) ? icons.circle : icons.polygon;
  const glyphs = {
    roads: icons.road,
    walls: icons.wall,
    movers: icons.circle,
    people: icons.person,
    sources: icons.source,
  };
  return glyphs[ref.kind];
}
