/** The page: one stage, one connection, three modes. */

import "./ui/style.css";
import { Between } from "./between";
import { Connection } from "./connection";
import { bodyOf } from "./figures/body";
import { People } from "./figures/people";
import { Skin } from "./figures/skin";
import { DatabaseMode } from "./modes/database/database";
import { takeDownloads } from "./modes/exports";
import type { Mode, ModeName, Page } from "./modes/mode";
import { SceneMode } from "./modes/scene/scene";
import { WalkMode } from "./modes/walk/walk";
import { Stage } from "./stage/stage";
import { takesArrows, takesText } from "./ui/dom";
import { Messages } from "./ui/messages";
import { pictureOptions, type PictureOptions } from "./ui/options";
import { Shell } from "./ui/shell";

/** `?ratio=0.5&shadows=0&smooth=0&poses=40&pictures=10` (a second) in the address: for slow machines and tests. */
function firstOptions(): PictureOptions {
  const asked = new URLSearchParams(location.search);
  const number = (name: string, otherwise: number): number => {
    const value = Number.parseFloat(asked.get(name) ?? "");
    return Number.isFinite(value) ? value : otherwise;
  };
  return {
    sharpness: Math.min(2, Math.max(0.2, number("ratio", 2))),
    shadows: number("shadows", 1) !== 0,
    smooth: number("smooth", 1) !== 0,
    spacing: asked.has("pictures") ? 1000 / Math.max(1, number("pictures", 60)) : 0,
    poses: Math.min(160, Math.max(0, number("poses", 120))),
  };
}

/** As many wear the skin; the others of the nearest are jointed figures, drawn all at once. */
const MOST_SKINNED = 12;

function begin(): void {
  const picture = firstOptions();
  const messages = new Messages();
  let stage: Stage;
  try {
    stage = new Stage({ ratio: picture.sharpness, shadows: picture.shadows, spacing: picture.spacing });
  } catch {
    messages.error("This browser draws no WebGL 2. Switch hardware or software WebGL on, or take another browser.");
    document.body.append(messages.element);
    return;
  }
  const where = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`;
  const connection = new Connection(where);
  const page: Page = {
    stage,
    connection,
    between: new Between(),
    messages,
    people: null,
    welcome: null,
    latency: null,
  };
  page.between.direct = !picture.smooth;

  const scene = new SceneMode(page, picture);
  const modes: Mode[] = [new WalkMode(page), scene, new DatabaseMode(page)];
  let mode = modes[0]!;
  const choose = (name: ModeName): void => {
    const next = modes.find((found) => found.name === name);
    if (!next || next === mode) return;
    mode.leave();
    mode = next;
    shell.show(mode);
    mode.enter();
    connection.send({ type: "mode", mode: mode.name });
    history.replaceState(null, "", `${location.pathname}${location.search}#${mode.name}`);
  };
  const options = pictureOptions(page, picture, () => scene.look());
  const shell = new Shell(stage.element, messages, connection, modes, choose, options);
  document.body.append(shell.element);
  const asked = modes.find((found) => `#${found.name}` === location.hash);
  if (asked) mode = asked;
  shell.show(mode);
  takeDownloads(page);

  let entered = false;
  connection.on("welcome", (welcome) => {
    const again = page.welcome !== null && !welcome.database.built && !page.welcome.database.built;
    dress(page, welcome);
    shell.database(welcome.database.name);
    shell.ready(null);
    connection.send({ type: "mode", mode: mode.name });
    for (const each of modes) each.welcome(welcome);
    if (!entered) {
      entered = true;
      mode.enter();
    } else if (again && welcome.session !== lastSession)
      messages.say("The connection is back, and everything is as you left it.", "good");
    lastSession = welcome.session;
  });
  let lastSession = "";
  connection.onLink((link) => {
    if (link === "waiting" && page.welcome)
      messages.say(connection.why || "The connection to the server broke. The page tries again by itself.", "error");
    if (link === "waiting" && !page.welcome)
      shell.ready(connection.why || "No server answers. Start one with: stridecast demo");
    if (link === "refused") messages.error(connection.why);
  });
  connection.on("error", (error) => {
    const place = error.place ? `${error.place}: ` : "";
    messages.error(`${place}${error.message}`);
  });
  connection.onFrame((frame, at) => {
    page.between.push(frame, at);
    mode.frame(frame, at);
  });
  stage.onTick((seconds, now) => mode.tick(seconds, now));

  const canvas = stage.canvas;
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      stage.cameras.zoom(Math.exp(event.deltaY * (event.deltaMode === 1 ? 0.04 : 0.0012)));
    },
    { passive: false },
  );
  addEventListener("keydown", (event) => {
    if (shell.busy || takesText(event.target)) return;
    const arrows = event.key.startsWith("Arrow") || event.key === "PageUp" || event.key === "PageDown";
    if (arrows && takesArrows(event.target)) return;
    // space and enter belong to the button that has the focus
    if (
      (event.key === " " || event.key === "Enter") &&
      event.target instanceof HTMLElement &&
      event.target.closest("button, a, summary, input, [role=row]")
    )
      return;
    if (mode.key(event) || pageKey(event)) event.preventDefault();
  });
  addEventListener("keyup", (event) => mode.keyUp?.(event));

  function pageKey(event: KeyboardEvent): boolean {
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    if (event.key === "?") shell.help();
    else if (event.key === "PageUp") stage.cameras.zoom(0.88);
    else if (event.key === "PageDown") stage.cameras.zoom(1.136);
    else if (event.key === "q" || event.key === "Q") stage.cameras.rotate(0.12, 0);
    else if (event.key === "e" || event.key === "E") stage.cameras.rotate(-0.12, 0);
    else return false;
    return true;
  }

  // for scripts that use the page as a hand would: where a place of the world is seen
  Object.assign(window, { stridecast: { seenAt: (x: number, y: number, z: number) => stage.seenAt(x, y, z) } });
  stage.run();
  connection.open();
}

/** Put the body of a session on the stage: jointed at once, skinned as soon as its skin is there. */
function dress(page: Page, welcome: NonNullable<Page["welcome"]>): void {
  const before = page.people;
  const same = page.welcome !== null && JSON.stringify(page.welcome.skeleton) === JSON.stringify(welcome.skeleton);
  page.welcome = welcome;
  if (same && before) return;
  if (before) page.stage.scene.remove(before.group);
  const people = new People(bodyOf(welcome.skeleton));
  page.people = people;
  page.stage.scene.add(people.group);
  const session = encodeURIComponent(welcome.session);
  const { character } = welcome;
  const skin = character
    ? Skin.wear(`character.glb?session=${session}`, people.body, MOST_SKINNED, character)
    : Skin.load(`body.glb?session=${session}`, people.body, MOST_SKINNED);
  const whose = character ? "meshes of the character" : "mannequin";
  skin
    .then((skin) => people.wear(skin))
    .catch((error: unknown) =>
      page.messages.say(`The ${whose} could not be loaded (${String(error)}); simpler figures are shown.`),
    );
}

begin();
