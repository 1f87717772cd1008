import { el } from "../../ui/dom";
import type { Mode, Page } from "../mode";
export class SceneMode implements Mode {
  readonly name = "scene";
  readonly left = el("div"); readonly right = el("div"); readonly foot = el("div"); readonly help = [];
  constructor(_page: Page, _options?: unknown) {}
  welcome(): void {} enter(): void {} leave(): void {} frame(): void {} tick(): void {} key(): boolean { return false; } look(): void {}
}
