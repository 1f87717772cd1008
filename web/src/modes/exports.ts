/** Downloads of what was played: asked of the server, saved by the browser. */

import { button } from "../ui/controls";
import { el } from "../ui/dom";
import { icons } from "../ui/icons";
import type { Page } from "./mode";

type What = "bvh" | "glb" | "csv" | "database";

/** A row of buttons, one a format. */
export function exportButtons(
  page: Page,
  formats: readonly (readonly [what: What, label: string, title: string])[],
): HTMLElement {
  return el(
    "div",
    { class: "button-row", role: "group", "aria-label": "Download" },
    ...formats.map(([what, label, title]) => button(label, () => ask(page, what), { title, icon: icons.save })),
  );
}

export function ask(page: Page, what: What): void {
  const request = page.connection.nextRequest();
  if (page.connection.send({ type: "export", what, request })) page.messages.say("The file is being made.");
  else page.messages.error("There is no connection to the server. Wait until it is back, then ask again.");
}

/** Save what is ready. Called once for the page. */
export function takeDownloads(page: Page): void {
  page.connection.on("export_ready", ({ url, name, bytes }) => {
    const link = el("a", { href: url, download: name, class: "visually-hidden" });
    document.body.append(link);
    link.click();
    link.remove();
    page.messages.say(`${name} (${size(bytes)}) is being saved.`, "good");
  });
}

/** Let the browser save a text that the page has. */
export function saveText(name: string, text: string, type: string): void {
  const url = URL.createObjectURL(new Blob([text], { type }));
  const link = el("a", { href: url, download: name, class: "visually-hidden" });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

export function size(bytes: number): string {
  if (bytes < 1000) return `${bytes} bytes`;
  if (bytes < 1e6) return `${(bytes / 1e3).toFixed(0)} kB`;
  return `${(bytes / 1e6).toFixed(1)} MB`;
}
