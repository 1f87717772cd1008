/** What a mode of the page is, and what all of them share. */

import type { Between } from "../between";
import type { Connection } from "../connection";
import type { Frame } from "../frames";
import type { People } from "../figures/people";
import type { Welcome } from "../protocol";
import type { Stage } from "../stage/stage";
import type { Messages } from "../ui/messages";

export type ModeName = "walk" | "scene" | "database";

/** What modes find on the page. */
export interface Page {
  readonly stage: Stage;
  readonly connection: Connection;
  readonly between: Between;
  readonly messages: Messages;
  /** Nothing before the first `welcome`. */
  people: People | null;
  welcome: Welcome | null;
  /** How long an input took to be seen, milliseconds, smoothed. */
  latency: number | null;
}

export interface Mode {
  readonly name: ModeName;
  readonly left: HTMLElement;
  readonly right: HTMLElement;
  /** Below the stage: a hint, or the timeline. */
  readonly foot: HTMLElement;
  /** A server is there, for the first time or again: tell it everything that it does not know. */
  welcome(welcome: Welcome): void;
  enter(): void;
  leave(): void;
  frame(frame: Frame, at: number): void;
  /** Before each picture. */
  tick(seconds: number, now: number): void;
  /** A key that no control wanted; whether it meant something. */
  key(event: KeyboardEvent): boolean;
  keyUp?(event: KeyboardEvent): void;
  /** Keys and gestures, for the help. */
  readonly help: readonly (readonly [keys: string, meaning: string])[];
}
