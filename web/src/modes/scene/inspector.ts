/** What can be set of the chosen things. */

import type {
  BehaviorPart,
  CirclePart,
  PersonPart,
  PolygonPart,
  RoadPart,
  ScenePart,
  SourcePart,
} from "../../protocol";
import { button, numberField, section, segmented, select, slider, textField, toggle } from "../../ui/controls";
import { el } from "../../ui/dom";
import { icons } from "../../ui/icons";
import { behave, goalsOf, isCircle, nameOf, partOf, type Ref, setGoals, update } from "./document";

export interface InspectorEvents {
  /** A new scene; changes of one `run` are taken back together. */
  change(scene: ScenePart, run: string): void;
  remove(): void;
}

const SIZES = (["calm", "neutral", "lively", "exaggerated"] as const).map((value) => ({ value, label: value }));
const SIDES = [
  { value: "none", label: "Either" },
  { value: "left", label: "Left" },
  { value: "right", label: "Right" },
] as const;

/** The panel for what is chosen. `current` gives the scene as it is when something is changed. */
export function inspector(current: () => ScenePart, chosen: readonly Ref[], events: InspectorEvents): HTMLElement {
  const scene = current();
  const first = chosen[0];
  const part = first && partOf(scene, first);
  if (!first || !part) {
    return section(
      "Nothing chosen",
      {},
      el(
        "p",
        { class: "hint" },
        "Click a thing on the ground, or pick one from the list, to change it. Click somebody who walks to learn what they are up to.",
      ),
    );
  }
  const alike = chosen.every((ref) => ref.kind === first.kind);
  const title = chosen.length === 1 ? nameOf(scene, first) : `${chosen.length} things`;
  const apply = (name: string, change: (scene: ScenePart, ref: Ref) => ScenePart): void => {
    events.change(
      chosen.reduce((next, ref) => change(next, ref), current()),
      `${name} ${chosen.map((ref) => `${ref.kind}${ref.index}`).join()}`,
    );
  };
  const set = (changes: Record<string, unknown>): void =>
    apply(Object.keys(changes).join(), (next, ref) => update(next, ref, changes));
  const fields: HTMLElement[] = [];
  if (chosen.length === 1) fields.push(textField("Name", part.name ?? "", (name) => name && set({ name })).element);
  if (alike && first.kind === "roads") {
    fields.push(
      slider({
        label: "Width",
        min: 0.8,
        max: 20,
        step: 0.1,
        value: (part as RoadPart).width,
        format: (w) => `${w.toFixed(1)} m`,
        onInput: (width) => set({ width }),
      }).element,
    );
  }
  if (alike && first.kind === "obstacles" && isCircle(part as CirclePart | PolygonPart)) {
    fields.push(
      slider({
        label: "Radius",
        min: 0.1,
        max: 8,
        step: 0.05,
        value: (part as CirclePart).radius,
        format: (r) => `${r.toFixed(2)} m`,
        onInput: (radius) => set({ radius }),
      }).element,
    );
  }
  if (alike && first.kind === "people")
    fields.push(
      ...personFields(part as PersonPart, set, (changes) =>
        apply(Object.keys(changes).join(), (next, ref) => behave(next, ref, changes)),
      ),
    );
  if (alike && first.kind === "sources") fields.push(...sourceFields(part as SourcePart, set));
  if (chosen.length === 1 && (first.kind === "people" || first.kind === "sources")) {
    const count = goalsOf(part as PersonPart | SourcePart).length;
    fields.push(
      el(
        "div",
        { class: "row" },
        el(
          "span",
          {},
          count === 0 ? "No goal: stands where they start" : count === 1 ? "One goal" : `${count} goals, in this order`,
        ),
        count > 0 &&
          button("Clear", () => apply("goals", (next, ref) => setGoals(next, ref, [])), {
            kind: "quiet",
            title: "Take all goals away; the goal tool adds new ones",
          }),
      ),
    );
  }
  return section(
    title,
    {},
    ...fields,
    el(
      "div",
      { class: "button-row" },
      button(chosen.length === 1 ? "Delete" : "Delete all", events.remove, { icon: icons.remove, key: "Delete" }),
    ),
  );
}

function personFields(
  person: PersonPart,
  set: (changes: Record<string, unknown>) => void,
  go: (changes: BehaviorPart) => void,
): HTMLElement[] {
  const behavior = person.behavior ?? {};
  const preference = behavior.preference ?? {};
  return [
    segmented(
      "Status",
      [
        { value: "walk", label: "Walk", icon: icons.walk },
        { value: "run", label: "Run", icon: icons.run },
      ],
      behavior.status ?? "walk",
      (status) =>
        go({
          status,
          velocity:
            status === "run" ? Math.max(2.6, behavior.velocity ?? 2.8) : Math.min(1.6, behavior.velocity ?? 1.3),
        }),
    ).element,
    slider({
      label: "Velocity",
      min: 0.3,
      max: 5,
      step: 0.05,
      value: behavior.velocity ?? 1.3,
      format: (v) => `${v.toFixed(2)} m/s`,
      onInput: (velocity) => go({ velocity }),
    }).element,
    slider({
      label: "Weight",
      min: 30,
      max: 150,
      step: 1,
      value: behavior.weight ?? 70,
      format: (v) => `${v} kg`,
      hint: "The heavier and faster, the wider the turns.",
      onInput: (weight) => go({ weight }),
    }).element,
    slider({
      label: "Mood",
      min: -1,
      max: 1,
      step: 0.05,
      value: behavior.style ?? 0,
      format: mood,
      onInput: (style) => go({ style }),
    }).element,
    select("Movements", SIZES, behavior.size ?? "neutral", (size) => go({ size })).element,
    segmented("Passes on the", SIDES, preference.side ?? "none", (side) => go({ preference: { ...preference, side } }))
      .element,
    segmented(
      "Keeps",
      [
        { value: "near", label: "Near" },
        { value: "far", label: "Far" },
      ],
      preference.distance ?? "near",
      (distance) => go({ preference: { ...preference, distance } }),
    ).element,
    segmented(
      "Where ways cross",
      [
        { value: "go", label: "Goes" },
        { value: "wait", label: "Waits" },
      ],
      preference.patience ?? "go",
      (patience) => go({ preference: { ...preference, patience } }),
    ).element,
    numberField({
      label: "Begins",
      value: person.begins ?? 0,
      min: 0,
      step: 0.5,
      unit: "s",
      onCommit: (begins) => set({ begins: begins ?? 0 }),
    }).element,
    numberField({
      label: "Height",
      value: person.height ?? null,
      min: 0.5,
      max: 2.5,
      step: 0.01,
      unit: "m",
      placeholder: "usual",
      onCommit: (height) => set({ height: height ?? undefined }),
    }).element,
    textField("Together", person.together ?? "", (together) => set({ together: together || undefined }), "nobody")
      .element,
    toggle("Stays at the last goal", person.stays ?? false, (stays) => set({ stays: stays || undefined })).element,
  ];
}

function sourceFields(source: SourcePart, set: (changes: Record<string, unknown>) => void): HTMLElement[] {
  const velocity = source.velocity ?? 1.3;
  const mean = typeof velocity === "number" ? velocity : velocity.mean;
  const style = source.style ?? 0;
  const weight = source.weight ?? 70;
  const preference = source.preference ?? {};
  const word = <T extends string>(value: T | object | undefined, otherwise: T): T =>
    typeof value === "string" ? value : otherwise;
  return [
    slider({
      label: "Flow",
      min: 0,
      max: 5,
      step: 0.05,
      value: source.flow ?? 0,
      format: (v) => `${v.toFixed(2)} people/s`,
      onInput: (flow) => set({ flow }),
    }).element,
    numberField({
      label: "There at once",
      value: source.at_once ?? 0,
      min: 0,
      max: 2000,
      step: 1,
      onCommit: (count) => set({ at_once: count ?? 0 }),
    }).element,
    numberField({
      label: "Altogether",
      value: source.most ?? null,
      min: 1,
      step: 1,
      placeholder: "no end",
      onCommit: (most) => set({ most: most ?? undefined }),
    }).element,
    slider({
      label: "Velocity",
      min: 0.3,
      max: 5,
      step: 0.05,
      value: mean,
      format: (v) => `${v.toFixed(2)} m/s`,
      onInput: (value) =>
        set({
          velocity:
            typeof velocity === "number"
              ? value
              : {
                  ...velocity,
                  mean: value,
                  least: Math.min(velocity.least ?? value, value),
                  most: Math.max(velocity.most ?? value, value),
                },
        }),
    }).element,
    segmented(
      "Status",
      [
        { value: "walk", label: "Walk", icon: icons.walk },
        { value: "run", label: "Run", icon: icons.run },
      ],
      source.status ?? "walk",
      (status) => set({ status }),
    ).element,
    slider({
      label: "Weight",
      min: 30,
      max: 150,
      step: 1,
      value: typeof weight === "number" ? weight : weight.mean,
      format: (v) => `${v} kg`,
      onInput: (value) => set({ weight: value }),
    }).element,
    slider({
      label: "Mood",
      min: -1,
      max: 1,
      step: 0.05,
      value: typeof style === "number" ? style : style.mean,
      format: mood,
      onInput: (value) => set({ style: value }),
    }).element,
    segmented("Pass on the", SIDES, word(preference.side, "none"), (side) =>
      set({ preference: { ...preference, side } }),
    ).element,
    segmented(
      "Where ways cross",
      [
        { value: "go", label: "Go" },
        { value: "wait", label: "Wait" },
      ],
      word(preference.patience, "go"),
      (patience) => set({ preference: { ...preference, patience } }),
    ).element,
  ];
}

const mood = (value: number): string =>
  Math.abs(value) < 0.15 ? "neutral" : `${value < 0 ? "gloomy" : "brisk"} ${Math.abs(value).toFixed(2)}`;
