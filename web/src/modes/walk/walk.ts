/** Walk mode: one character under the hand, and why it moves so. */

import { Mesh, MeshBasicMaterial, RingGeometry } from "three";
import type { Frame } from "../../frames";
import { CLAMPED, type SettingsMessage, type SettingsState, type Welcome } from "../../protocol";
import { GraphDrawing } from "../../plots/graph";
import { Meter } from "../../plots/meter";
import { Strip } from "../../plots/strip";
import type { View } from "../../stage/cameras";
import { Footprints } from "../../stage/footprints";
import { palette } from "../../stage/palette";
import { Ribbon } from "../../stage/ribbon";
import type { Spot } from "../../stage/stage";
import { button, type Control, section, segmented, select, slider, toggle } from "../../ui/controls";
import { el, setText } from "../../ui/dom";
import { icons } from "../../ui/icons";
import { Reading } from "../../ui/messages";
import type { Mode, Page } from "../mode";
import { exportButtons } from "../exports";
import { type Hand, Steering } from "./steering";

type Motion = SettingsState["motion"];
type Size = SettingsState["size"];
type Settings = Omit<SettingsState, "type">;

const HANDS: Record<Hand, string> = {
  rest: "Move the mouse over the ground: the character follows. Hold to place a target, drag to draw a way, W A S D or arrows to drive.",
  mouse: "Follows the mouse. Hold to place a target, drag to draw a way.",
  target: "Goes to the target. Click, or press Esc, to take over again.",
  drawing: "Let go, and the line is walked.",
  curve: "Walks the line that you drew. Click, or press Esc, to take over again.",
  keys: "Driven by the keys. Let go, and it stops.",
  pad: "Driven by the stick.",
};

/** Speeds that go with a motion until one is chosen. */
const USUAL: Record<Motion, number> = { stand: 1.3, walk: 1.3, run: 3.2 };

export class WalkMode implements Mode {
  readonly name = "walk";
  readonly left = el("div", { class: "panel-body" });
  readonly right = el("div", { class: "panel-body" });
  readonly foot = el("div", { class: "hint-bar" });
  readonly help = [
    ["Mouse", "the character follows the place under it"],
    ["Hold", "place a target"],
    ["Drag", "draw a way to be walked"],
    ["W A S D, arrows", "drive, as seen from the camera; let go to stop"],
    ["1 2 3", "stand, walk, run"],
    ["+ −", "faster, slower"],
    ["F O T", "camera: follow, orbit, top"],
    ["Right drag, Q E", "turn the camera; wheel, Page up and down: nearer, farther"],
    ["Left stick", "push and pull; right stick turns the camera; A B X: walk, run, stand"],
    ["Esc", "let go of target and line"],
    ["R", "begin anew"],
  ] as const;

  private readonly steering: Steering;
  private settings: Settings | null = null;
  private readonly speeds: Record<Motion, number> = { ...USUAL };
  private readonly hint = el("p", { class: "hint-text", role: "status" }, HANDS.rest);
  private controls: {
    motion: Control<Motion>;
    speed: Control<number>;
    turn: Control<number>;
    style: Control<number>;
    size: Control<Size>;
    halfLife: Control<number>;
    damping: Control<number>;
    view: Control<View>;
  } | null = null;

  // on the floor
  private readonly trails = {
    input: new Ribbon({ colour: palette.input, width: 0.028, height: 0.018, capacity: 420 }),
    vehicle: new Ribbon({ colour: palette.vehicle, width: 0.034, height: 0.02, capacity: 420 }),
    pelvis: new Ribbon({ colour: palette.pelvis, width: 0.026, height: 0.022, capacity: 420 }),
  };
  private readonly way = new Ribbon({
    colour: palette.accent,
    width: 0.06,
    height: 0.014,
    capacity: 2000,
    opacity: 0.4,
    fades: false,
  });
  private readonly sketch = new Ribbon({
    colour: palette.input,
    width: 0.05,
    height: 0.024,
    capacity: 4000,
    opacity: 0.8,
    fades: false,
  });
  private readonly prints = new Footprints(80);
  private readonly target: Mesh;
  private readonly dot: Mesh;

  // beside it
  private readonly meters = {
    speed: new Meter("Speed", "Least and greatest speed of the motion that plays", "m/s"),
    tangential: new Meter("Along", "Speeding up and braking", "m/s²"),
    lateral: new Meter("Across", "Turning", "m/s²"),
    jerk: new Meter("Change", "How fast the acceleration changes", "m/s³"),
  };
  private readonly strips = {
    speed: new Strip("Speed", "m/s", [0, 2]),
    tangential: new Strip("Acceleration along", "m/s²", [-1, 1]),
    lateral: new Strip("Acceleration across", "m/s²", [0, 1]),
  };
  private readonly graph = new GraphDrawing();
  private readonly readings = {
    segment: new Reading("Segment", "How many segments have begun"),
    picture: new Reading("Picture", "Time between pictures"),
    latency: new Reading("Latency", "From a sample of the input to the first picture that shows its effect"),
    step: new Reading("Step", "Mean time of a step on the server"),
  };
  private stepMs: number | null = null;
  private echo = 0;
  private echoPending = 0;
  private plotted = 0;
  private footLength = 0.1;

  constructor(private readonly page: Page) {
    this.steering = new Steering(page.stage, {
      wish: (wish, at) => page.connection.send({ type: "wish", wish, at }),
      hand: (hand) => setText(this.hint, HANDS[hand]),
      drawing: (points) => this.sketch.set(points.flatMap((spot) => [spot.x, spot.z])),
      target: (spot) => this.mark(spot),
      padButton: (number) => {
        const motion = (["walk", "run", "stand"] as const)[number];
        if (motion) this.choose({ motion });
      },
    });
    const flat = (inner: number, outer: number, colour: number, opacity: number): Mesh => {
      const mesh = new Mesh(
        new RingGeometry(inner, outer, 40).rotateX(-Math.PI / 2),
        new MeshBasicMaterial({ color: colour, transparent: true, opacity, depthWrite: false, toneMapped: false }),
      );
      mesh.position.y = 0.026;
      mesh.renderOrder = 6;
      mesh.visible = false;
      return mesh;
    };
    this.target = flat(0.16, 0.21, palette.input, 0.95);
    this.dot = flat(0, 0.045, palette.input, 0.95);
    this.foot.append(this.hint);
    this.fillRight();
    this.listen();
  }

  private listen(): void {
    const { connection } = this.page;
    connection.on("settings_state", (state) => this.settled(state));
    connection.on("footprint", (print) => {
      const ahead = this.footLength * 0.55; // from the ankle to the middle of the sole
      this.prints.add(
        print.position[0] + Math.sin(print.heading) * ahead,
        print.position[1] + Math.cos(print.heading) * ahead,
        print.heading,
        print.side === "left",
      );
    });
    connection.on("way", (way) => {
      this.way.set(way.points.flat());
      if (way.arrived) this.steering.arrived();
    });
    connection.on("health", (health) => {
      if (health.mode === "walk") this.stepMs = health.step_ms;
    });
  }

  welcome(welcome: Welcome): void {
    const { skeleton } = welcome;
    const toe = skeleton.roles["left_toe"];
    if (toe !== undefined) this.footLength = Math.hypot(...(skeleton.offsets[toe] ?? [0.12, 0, 0]));
    this.graph.set(welcome.database);
    this.between();
    if (this.controls === null) this.fillLeft(welcome);
    const kept = this.settings;
    this.settled(welcome.settings);
    if (kept) this.choose(kept); // what was set before the connection broke
    this.steering.renew();
  }

  enter(): void {
    const { stage, between } = this.page;
    between.clear();
    this.between();
    stage.shadowReach = 7;
    stage.setReach(70);
    stage.scene.add(
      this.target,
      this.dot,
      this.prints.mesh,
      this.way.mesh,
      this.sketch.mesh,
      ...Object.values(this.trails).map((trail) => trail.mesh),
    );
    this.steering.enter();
    this.chooseView(this.controls?.view.get() ?? "follow");
  }

  leave(): void {
    this.steering.leave();
    this.page.stage.scene.remove(
      this.target,
      this.dot,
      this.prints.mesh,
      this.way.mesh,
      this.sketch.mesh,
      ...Object.values(this.trails).map((trail) => trail.mesh),
    );
  }

  /** Begin with clean ground. */
  private between(): void {
    for (const trail of Object.values(this.trails)) trail.clear();
    this.way.clear();
    this.prints.clear();
    for (const strip of Object.values(this.strips)) strip.clear();
    this.mark(null);
    this.echo = this.echoPending = 0;
  }

  frame(frame: Frame, at: number): void {
    const { steering, playing } = frame;
    if (!steering || !playing) return;
    const [x, z] = [frame.places[0]!, frame.places[1]!];
    this.steering.walker = { x, z };
    if (Number.isFinite(steering.input_x)) {
      this.trails.input.add(steering.input_x, steering.input_z);
      this.dot.position.set(steering.input_x, this.dot.position.y, steering.input_z);
    }
    this.dot.visible = Number.isFinite(steering.input_x) && this.trails.input.mesh.visible;
    this.trails.vehicle.add(x, z);
    this.trails.pelvis.add(frame.roots[0]!, frame.roots[2]!);
    const acted = (name: (typeof CLAMPED)[number]): boolean => (playing.clamped & (1 << CLAMPED.indexOf(name))) !== 0;
    const speed = Math.hypot(steering.velocity_x, steering.velocity_z);
    this.meters.speed.set(speed, 0, steering.most_speed, acted("speed"), at);
    this.meters.tangential.set(
      steering.tangential,
      steering.least_tangential,
      steering.most_tangential,
      acted("tangential"),
      at,
    );
    this.meters.lateral.set(Math.abs(steering.lateral), 0, steering.most_lateral, acted("lateral"), at);
    this.meters.jerk.set(steering.jerk, 0, steering.most_jerk, acted("jerk"), at);
    this.strips.speed.add(frame.time, speed, steering.least_speed, steering.most_speed, acted("speed"));
    this.strips.tangential.add(
      frame.time,
      steering.tangential,
      steering.least_tangential,
      steering.most_tangential,
      acted("tangential"),
    );
    this.strips.lateral.add(frame.time, Math.abs(steering.lateral), 0, steering.most_lateral, acted("lateral"));
    this.graph.show(playing.group, steering.generic);
    this.readings.segment.set(String(playing.segment));
    if (frame.echo > this.echo) {
      this.echo = frame.echo;
      this.echoPending = frame.echo; // measured when the picture is drawn
    }
  }

  tick(_seconds: number, now: number): void {
    const { stage, between, people } = this.page;
    const share = between.sample(now);
    const frame = between.newest;
    if (frame && frame.kind === 1 && people && frame.count > 0) {
      people.show(
        [
          {
            x: between.places[0]!,
            z: between.places[1]!,
            heading: between.places[2]!,
            scale: 1,
            colour: palette.body,
            roots: frame.full ? between.roots : null,
            rotations: between.rotations,
            rootAt: 0,
            rotationAt: 0,
          },
        ],
        stage.camera.position,
      );
      stage.cameras.follow(between.places[0]!, 0.85, between.places[1]!);
      stage.cameras.keepNear(between.places[0]!, between.places[1]!, 6);
    }
    if (this.echoPending && share > 0) {
      const took = performance.now() - this.echoPending;
      this.echoPending = 0;
      if (took < 2000)
        this.page.latency = this.page.latency === null ? took : this.page.latency + (took - this.page.latency) * 0.1;
    }
    this.steering.tick(now);
    for (const trail of Object.values(this.trails)) trail.update();
    this.way.update();
    this.sketch.update();
    for (const meter of Object.values(this.meters)) meter.tick(now);
    if (now - this.plotted > 66) {
      this.plotted = now;
      for (const strip of Object.values(this.strips)) strip.update();
      this.readings.picture.set(`${(stage.frameTime * 1000).toFixed(1)} ms`);
      this.readings.latency.set(this.page.latency === null ? "–" : `${this.page.latency.toFixed(0)} ms`);
      this.readings.step.set(this.stepMs === null ? "–" : `${this.stepMs.toFixed(2)} ms`);
    }
  }

  key(event: KeyboardEvent): boolean {
    if (this.steering.key(event)) return true;
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    const motions: Record<string, Motion> = { "1": "stand", "2": "walk", "3": "run" };
    const views: Record<string, View> = { f: "follow", o: "orbit", t: "top" };
    const key = event.key.toLowerCase();
    if (motions[key]) this.choose({ motion: motions[key] });
    else if (views[key]) {
      this.chooseView(views[key]);
      this.controls?.view.set(views[key]);
    } else if (key === "+" || key === "=") this.nudge(0.1);
    else if (key === "-") this.nudge(-0.1);
    else if (key === "escape") this.steering.free();
    else if (key === "r") this.anew();
    else return false;
    return true;
  }

  keyUp(event: KeyboardEvent): void {
    this.steering.keyUp(event);
  }

  private nudge(by: number): void {
    if (this.settings) this.choose({ speed: Math.round((this.settings.speed + by) * 10) / 10 });
  }

  private anew(): void {
    this.steering.free();
    this.between();
    this.page.connection.send({ type: "place", position: [0, 0], heading: 0 });
  }

  private mark(spot: Spot | null): void {
    this.target.visible = spot !== null;
    if (spot) this.target.position.set(spot.x, this.target.position.y, spot.z);
  }

  private chooseView(view: View): void {
    this.page.stage.cameras.set(view);
  }

  /** What the server says is so. */
  private settled(state: Settings): void {
    const { motion, speed, turn, style, size, half_life, damping_ratio } = state;
    this.settings = { motion, speed, turn, style, size, half_life, damping_ratio };
    if (motion !== "stand") this.speeds[motion] = speed;
    const controls = this.controls;
    if (!controls) return;
    controls.motion.set(motion);
    const unlessHeld = (control: Control<number>, value: number): void => {
      if (!control.element.contains(document.activeElement) || !control.element.matches(":active, :has(:active)"))
        control.set(value);
    };
    unlessHeld(controls.speed, speed);
    unlessHeld(controls.turn, turn);
    unlessHeld(controls.style, style);
    unlessHeld(controls.halfLife, half_life);
    unlessHeld(controls.damping, damping_ratio);
    controls.size.set(size);
  }

  private choose(changes: Partial<Settings>): void {
    const wanted: Partial<Settings> = { ...changes };
    // another motion brings its own speed along
    if (
      wanted.motion &&
      wanted.speed === undefined &&
      wanted.motion !== "stand" &&
      wanted.motion !== this.settings?.motion
    ) {
      wanted.speed = this.speeds[wanted.motion];
    }
    if (wanted.speed !== undefined)
      wanted.speed = Math.min(
        Number(this.controls?.speed.element.querySelector("input")?.max ?? 12),
        Math.max(0.3, wanted.speed),
      );
    if (this.settings) Object.assign(this.settings, wanted);
    if (this.settings && wanted.motion) this.controls?.motion.set(wanted.motion);
    if (wanted.speed !== undefined) {
      this.controls?.speed.set(wanted.speed);
      if (this.settings && this.settings.motion !== "stand") this.speeds[this.settings.motion] = wanted.speed;
    }
    const message: SettingsMessage = { type: "settings", ...wanted, at: performance.now() };
    this.page.connection.send(message);
  }

  private fillLeft(welcome: Welcome): void {
    const { database, settings } = welcome;
    const top = Math.max(2, ...Object.values(database.top_speeds));
    const motionIcons = { stand: icons.stand, walk: icons.walk, run: icons.run };
    const motions = (["stand", "walk", "run"] as const).filter(
      (motion) => motion === "stand" || database.motions.includes(motion),
    );
    const controls = (this.controls = {
      motion: segmented<Motion>(
        "Motion",
        motions.map((motion) => ({
          value: motion,
          label: motion[0]!.toUpperCase() + motion.slice(1),
          icon: motionIcons[motion],
          title: `Key ${["stand", "walk", "run"].indexOf(motion) + 1}`,
        })),
        settings.motion,
        (motion) => this.choose({ motion }),
      ),
      speed: slider({
        label: "Speed",
        min: 0.3,
        max: Math.ceil(top * 10) / 10,
        step: 0.05,
        value: settings.speed,
        format: (value) => `${value.toFixed(2)} m/s`,
        onInput: (speed) => this.choose({ speed }),
      }),
      turn: slider({
        label: "Turning",
        min: 0.05,
        max: 1,
        step: 0.01,
        value: settings.turn,
        format: (value) => `${Math.round(value * 100)} %`,
        onInput: (turn) => this.choose({ turn }),
      }),
      style: slider({
        label: "Mood",
        min: Math.max(-1, Math.floor(Math.min(database.styles[0], -0.1) * 20) / 20),
        max: Math.min(1, Math.ceil(Math.max(database.styles[1], 0.1) * 20) / 20),
        step: 0.05,
        value: settings.style,
        format: (value) =>
          Math.abs(value) < 0.15 ? "neutral" : `${value < 0 ? "gloomy" : "brisk"} ${Math.abs(value).toFixed(2)}`,
        onInput: (style) => this.choose({ style }),
      }),
      size: select<Size>(
        "Movements",
        (["calm", "neutral", "lively", "exaggerated"] as const).map((value) => ({ value, label: value })),
        settings.size,
        (size) => this.choose({ size }),
      ),
      halfLife: slider({
        label: "Half-life of the spring",
        min: 0.05,
        max: 1.5,
        step: 0.01,
        value: settings.half_life,
        format: (value) => `${value.toFixed(2)} s`,
        onInput: (half_life) => this.choose({ half_life }),
      }),
      damping: slider({
        label: "Damping ratio",
        min: 0.2,
        max: 3,
        step: 0.05,
        value: settings.damping_ratio,
        onInput: (damping_ratio) => this.choose({ damping_ratio }),
      }),
      view: segmented<View>(
        "Camera",
        [
          { value: "follow", label: "Follow", icon: icons.follow, title: "Key F" },
          { value: "orbit", label: "Orbit", icon: icons.orbit, title: "Key O" },
          { value: "top", label: "Top", icon: icons.top, title: "Key T" },
        ],
        "follow",
        (view) => this.chooseView(view),
      ),
    });
    const shown = (name: keyof typeof this.trails) => (on: boolean) => {
      this.trails[name].mesh.visible = on;
    };
    this.left.append(
      section(
        "Steer",
        {},
        controls.motion.element,
        controls.speed.element,
        controls.turn.element,
        controls.style.element,
        controls.size.element,
      ),
      section(
        "See",
        {},
        controls.view.element,
        el(
          "div",
          { class: "legend" },
          toggle("Input", true, shown("input"), "input").element,
          toggle("Vehicle", true, shown("vehicle"), "vehicle").element,
          toggle("Pelvis", true, shown("pelvis"), "pelvis").element,
          toggle("Footprints", true, (on) => (this.prints.mesh.visible = on), "print").element,
        ),
      ),
      section(
        "Spring and lines",
        { fold: true, open: false },
        controls.halfLife.element,
        controls.damping.element,
        segmented<"path" | "curve">(
          "Drawn lines",
          [
            { value: "path", label: "Keep to it", title: "The line itself is walked, with the speed planned ahead" },
            {
              value: "curve",
              label: "Follow a point",
              title: "A point runs along the line and is followed, as in the paper",
            },
          ],
          "path",
          (kind) => (this.steering.exact = kind === "path"),
        ).element,
      ),
      section(
        "Take it with you",
        {},
        exportButtons(this.page, [
          ["bvh", "BVH", "The motion, for animation programs"],
          ["glb", "GLB", "The figure in motion, for viewers and engines"],
          ["csv", "CSV", "Everything about every frame"],
        ]),
        button("Begin anew", () => this.anew(), { kind: "quiet", icon: icons.restart, key: "R" }),
      ),
    );
  }

  private fillRight(): void {
    this.right.append(
      section(
        "Bounds that act",
        {},
        el("ul", { class: "meters" }, ...Object.values(this.meters).map((meter) => meter.element)),
      ),
      section("Against what was learned", {}, ...Object.values(this.strips).map((strip) => strip.element)),
      section("Playing now", {}, this.graph.caption, this.graph.element),
      section(
        "Pace",
        {},
        el("dl", { class: "readings two" }, ...Object.values(this.readings).map((reading) => reading.element)),
      ),
    );
  }
}
