/** What is said while people's ways are searched for, which may take a while and can be given up. */

import type { Connection } from "../../connection";
import { button } from "../../ui/controls";
import { el, setText } from "../../ui/dom";

export class Finding {
  private readonly bar = el("progress", { class: "progress", "aria-label": "Ways found" });
  private readonly text = el("span", { class: "finding-text" });
  private readonly cancel: HTMLButtonElement;
  readonly element: HTMLElement;

  constructor(connection: Connection) {
    this.cancel = button("Cancel", () => connection.send({ type: "cancel", what: "ways" }), {
      title: "Give the search up; what walks stays as it is",
    });
    this.element = el("div", { class: "finding", role: "status" }, this.text, this.bar, this.cancel);
    this.hide();
    connection.on("progress", ({ stage, done, total }) => {
      if (stage === "ways" && done < total) this.show(`Finding ways: ${done} of ${total}`, done / total);
      else if (stage === "ways") this.hide();
      else if (stage === "compile") this.show("Compiling the crowd, once on this machine: this takes a minute", null);
    });
    connection.on("scene_checked", () => this.hide());
    connection.onLink((link) => link !== "open" && this.hide());
  }

  private show(text: string, part: number | null): void {
    setText(this.text, text);
    if (part === null) this.bar.removeAttribute("value");
    else this.bar.value = part;
    this.cancel.hidden = part === null;
    this.element.hidden = false;
  }

  private hide(): void {
    this.element.hidden = true;
  }
}
