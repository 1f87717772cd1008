import { describe, expect, it } from "vitest";
import type { ScenePart } from "../src/protocol";
import * as doc from "../src/modes/scene/document";
import { History } from "../src/modes/scene/history";
import { crossing } from "../src/modes/scene/starter";

const frozen = <T>(value: T): T => {
  if (value && typeof value === "object") {
    Object.values(value).forEach(frozen);
    Object.freeze(value);
  }
  return value;
};

const scene = frozen(structuredClone(crossing));

describe("a scene", () => {
  it("is never changed in place", () => {
    for (const ref of doc.allOf(scene)) {
      doc.moveBy(scene, ref, 1, 2);
      doc.remove(scene, [ref]);
      doc.update(scene, ref, { name: "other" });
      for (const handle of doc.handlesOf(scene, ref)) doc.moveHandle(scene, ref, handle, 3, 4);
    }
    expect(scene).toEqual(crossing);
  });

  it("gives back what was added, and is the old one without it", () => {
    const [next, ref] = doc.add(scene, "obstacles", { center: [1, 2], radius: 0.5 });
    expect(doc.partOf(next, ref)).toMatchObject({ center: [1, 2], radius: 0.5 });
    expect(doc.remove(next, [ref])).toEqual(scene);
  });

  it("names things apart", () => {
    let next: ScenePart = doc.EMPTY;
    for (let i = 0; i < 6; i++) [next] = doc.add(next, "people", { start: [i, 0] });
    next = doc.remove(next, [{ kind: "people", index: 1 }]);
    [next] = doc.add(next, "people", { start: [9, 0] });
    const names = doc.listOf(next, "people").map((person) => person.name);
    expect(new Set(names).size).toBe(names.length);
  });

  it("comes back when a thing is moved there and back", () => {
    for (const ref of doc.allOf(scene)) {
      const there = doc.moveBy(scene, ref, 1.25, -0.5);
      expect(there).not.toEqual(scene);
      expect(doc.moveBy(there, ref, -1.25, 0.5)).toEqual(scene);
    }
  });

  it("has each handle where it was dragged", () => {
    for (const ref of doc.allOf(scene)) {
      doc.handlesOf(scene, ref).forEach((handle, i) => {
        const part = doc.partOf(scene, ref)!;
        const onlyRadius = "center" in part && i === 1;
        const [x, z] = onlyRadius ? [part.center[0] + 2, part.center[1]] : [7.5, -3.25];
        const moved = doc.handlesOf(doc.moveHandle(scene, ref, handle, x, z), ref)[i]!;
        expect([moved.x, moved.z]).toEqual([x, z]);
      });
    }
  });

  it("finds what lies at a place, people before what they stand on", () => {
    expect(doc.thingAt(scene, -13, 0.6, 0.2)).toEqual({ kind: "people", index: 0 });
    expect(doc.thingAt(scene, -3.4, 2, 0.2)).toEqual({ kind: "obstacles", index: 0 });
    expect(doc.thingAt(scene, 9, 2.5, 0.2)).toEqual({ kind: "roads", index: 0 });
    expect(doc.thingAt(scene, 40, 40, 0.2)).toBeNull();
  });

  it("removes several things of several kinds at once", () => {
    const refs: doc.Ref[] = [
      { kind: "people", index: 0 },
      { kind: "people", index: 2 },
      { kind: "roads", index: 1 },
    ];
    const left = doc.remove(scene, refs);
    expect(doc.listOf(left, "people").map((person) => person.name)).toEqual(["Ben", "Dan", "Eve", "Finn", "Gil"]);
    expect(doc.listOf(left, "roads")).toHaveLength(1);
  });

  it("merges how a person goes", () => {
    const ref = { kind: "people", index: 0 } as const;
    const next = doc.behave(doc.behave(scene, ref, { weight: 90 }), ref, { status: "run" });
    expect((doc.partOf(next, ref) as { behavior: object }).behavior).toEqual({
      velocity: 1.4,
      weight: 90,
      status: "run",
    });
  });
});

describe("the history", () => {
  it("goes back and forth through all states", () => {
    const history = new History(0);
    for (let i = 1; i <= 5; i++) history.push(i);
    const back: number[] = [];
    while (history.undo()) back.push(history.present);
    expect(back).toEqual([4, 3, 2, 1, 0]);
    const forth: number[] = [];
    while (history.redo()) forth.push(history.present);
    expect(forth).toEqual([1, 2, 3, 4, 5]);
  });

  it("takes a run back at once, and two runs one by one", () => {
    const history = new History("a");
    for (const state of ["b", "c", "d"]) history.push(state, "drag");
    history.seal();
    for (const state of ["e", "f"]) history.push(state, "drag");
    history.undo();
    expect(history.present).toBe("d");
    history.undo();
    expect(history.present).toBe("a");
    expect(history.canUndo).toBe(false);
  });

  it("forgets what was taken back once something new is done", () => {
    const history = new History(1);
    history.push(2);
    history.undo();
    history.push(3);
    expect(history.redo()).toBe(false);
    expect(history.present).toBe(3);
  });
});
