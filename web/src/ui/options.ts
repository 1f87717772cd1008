/** How the picture is made, for those whose machine is slow or whose screen is fine. */

import GUI from "lil-gui";
import "../../node_modules/lil-gui/dist/lil-gui.css"; // not among the exports of the package
import type { Page } from "../modes/mode";
import { el } from "./dom";

export interface PictureOptions {
  sharpness: number;
  shadows: boolean;
  smooth: boolean;
  poses: number;
  spacing: number;
}

/** The folded panel of the picture's options. */
export function pictureOptions(
  page: Page,
  options: PictureOptions,
  changed: (options: PictureOptions) => void,
): HTMLElement {
  const element = el("div", { class: "options", role: "group", "aria-label": "Picture" });
  const gui = new GUI({ container: element, title: "Picture", injectStyles: false, width: 260 });
  gui
    .add(options, "sharpness", 0.4, 2, 0.1)
    .name("Sharpness")
    .onChange((ratio: number) => page.stage.setRatio(ratio));
  gui
    .add(options, "shadows")
    .name("Shadows")
    .onChange((on: boolean) => page.stage.setShadows(on));
  gui
    .add(options, "smooth")
    .name("Smooth between frames")
    .onChange((on: boolean) => (page.between.direct = !on));
  gui.add(options, "poses", 0, 160, 1).name("Full figures, at most");
  gui.onFinishChange(() => changed(options));
  return element;
}
