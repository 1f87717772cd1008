/** Own recordings: dropped on the page, sent to the server, made into a database. */

import type { LimitsPart } from "../../protocol";
import { button } from "../../ui/controls";
import { el, setText } from "../../ui/dom";
import { icons } from "../../ui/icons";
import { size } from "../exports";
import type { Page } from "../mode";

const STAGES: Record<string, string> = {
  read: "Reading",
  analyse: "Analysing",
  assemble: "Assembling",
  compile: "Getting ready",
};

export class Uploading {
  readonly element = el("div", { class: "uploading" });
  private readonly zone: HTMLElement;
  private readonly files = el("p", { class: "hint file-list" });
  private readonly bar = el("progress", { class: "progress", max: 1, value: 0, "aria-label": "Progress" });
  private readonly stage = el("p", { class: "hint", role: "status" });
  private readonly buildButton = button("Build a database", () => this.build(), { kind: "primary" });
  private readonly cancelButton = button(
    "Cancel",
    () => this.page.connection.send({ type: "cancel", what: "build" }),
    {},
  );
  private readonly forgetButton = button("Forget them", () => this.page.connection.send({ type: "forget_files" }), {
    kind: "quiet",
  });
  private readonly useButton = button("Use it", () => this.use("built"), { kind: "primary" });
  private readonly backButton = button("Back to the one before", () => this.use("given"), {});
  private readonly input: HTMLInputElement;
  private building = false;
  private built = false;
  private count = 0;

  constructor(private readonly page: Page) {
    const input = (this.input = el("input", {
      type: "file",
      multiple: true,
      class: "visually-hidden",
      tabindex: -1,
      "aria-label": "Recordings",
    }));
    input.addEventListener("change", () => {
      void this.send([...(input.files ?? [])]);
      input.value = "";
    });
    this.zone = el(
      "div",
      { class: "drop" },
      el(
        "p",
        {},
        el("strong", {}, "Drop your recordings here"),
        el("br"),
        "BVH, AMC with its ASF, AMASS (NPZ), C3D or GLB",
      ),
      button("Choose files", () => input.click(), { icon: icons.open }),
      input,
    );
    this.element.append(
      this.zone,
      this.files,
      this.bar,
      this.stage,
      el(
        "div",
        { class: "button-row" },
        this.buildButton,
        this.cancelButton,
        this.useButton,
        this.backButton,
        this.forgetButton,
      ),
    );
    const { connection, messages } = page;
    connection.on("files", ({ files, bytes }) => this.have(files, bytes));
    connection.on("progress", ({ stage, done, total }) => {
      if (!STAGES[stage] || !this.building) return;
      this.bar.value = total ? done / total : 0;
      setText(this.stage, `${STAGES[stage]} ${done} of ${total} …`);
    });
    connection.on("built", ({ takes, left_out, examples, seconds, motions }) => {
      this.building = false;
      this.built = true;
      setText(
        this.stage,
        `Built: ${examples} segments of ${motions.join(", ")} from ${takes} takes (${seconds.toFixed(0)} s)${left_out ? `, ${left_out} left out` : ""}.`,
      );
      messages.say("The database is built. Press “Use it” to walk with it.", "good");
      this.show();
    });
    connection.on("error", ({ code }) => {
      if (code !== "build" && code !== "cancelled") return;
      this.building = false;
      setText(this.stage, code === "cancelled" ? "Cancelled." : "");
      this.show();
    });
    this.show();
  }

  /** Files dropped anywhere on the page. */
  listen(target: HTMLElement, active: () => boolean): void {
    const over = (on: boolean): void => void this.zone.classList.toggle("over", on);
    target.addEventListener("dragover", (event) => {
      if (!active()) return;
      event.preventDefault();
      over(true);
    });
    target.addEventListener("dragleave", () => over(false));
    target.addEventListener("drop", (event) => {
      if (!active()) return;
      event.preventDefault();
      over(false);
      void this.send([...(event.dataTransfer?.files ?? [])]);
    });
  }

  /** Nothing outlives a connection on the server. */
  renew(built: boolean): void {
    this.building = false;
    if (!built) {
      this.have([], 0);
      this.built = false;
    }
    this.using = built;
    this.input.accept = this.page.welcome?.limits.file_kinds.join() ?? "";
    this.show();
  }

  private using = false;

  private have(files: string[], bytes: number): void {
    this.count = files.length;
    setText(
      this.files,
      files.length
        ? `${files.length} ${files.length === 1 ? "file" : "files"}, ${size(bytes)}: ${files.slice(0, 6).join(", ")}${files.length > 6 ? " …" : ""}`
        : "",
    );
    this.show();
  }

  private async send(files: File[]): Promise<void> {
    const { messages, welcome } = this.page;
    if (!welcome) return;
    for (const [i, file] of files.entries()) {
      const wrong = refusal(file, welcome.limits);
      if (wrong) {
        messages.error(wrong);
        continue;
      }
      setText(this.stage, `Sending ${file.name} (${i + 1} of ${files.length}) …`);
      try {
        const query = new URLSearchParams({ session: welcome.session, name: file.name });
        const answer = await fetch(`files?${query}`, {
          method: "POST",
          body: file,
          headers: { "Content-Type": "application/octet-stream" },
        });
        const said = (await answer.json()) as {
          error?: string;
          files?: string[];
          bytes?: number;
        };
        if (!answer.ok) messages.error(said.error ?? `The server did not take ${file.name}.`);
        else this.have(said.files ?? [], said.bytes ?? 0);
      } catch {
        messages.error(`${file.name} did not reach the server. Drop it again when the connection is back.`);
        break;
      }
    }
    setText(this.stage, "");
  }

  private build(): void {
    const { connection } = this.page;
    if (!connection.send({ type: "build", request: connection.nextRequest() })) return;
    this.building = true;
    this.built = false;
    this.bar.value = 0;
    setText(this.stage, "Beginning …");
    this.show();
  }

  private use(database: "built" | "given"): void {
    this.page.connection.send({ type: "use", database, request: this.page.connection.nextRequest() });
  }

  private show(): void {
    this.bar.hidden = !this.building;
    this.buildButton.hidden = this.building;
    this.buildButton.disabled = this.count === 0;
    this.cancelButton.hidden = !this.building;
    this.forgetButton.hidden = this.building || this.count === 0;
    this.useButton.hidden = !this.built || this.using;
    this.backButton.hidden = !this.using;
  }
}

/** Why a file need not be sent, if so. */
export function refusal(file: { name: string; size: number }, limits: LimitsPart): string | null {
  const kinds = limits.file_kinds.map((kind) => kind.replace(/^\./, "").toLowerCase());
  const kind = file.name.split(".").pop()?.toLowerCase() ?? "";
  if (!kinds.includes(kind))
    return `${file.name} is no recording that can be read. Drop ${kinds.map((word) => word.toUpperCase()).join(", ")} files.`;
  if (file.size > limits.file_bytes)
    return `${file.name} has ${size(file.size)}. Files have ${size(limits.file_bytes)} at most: cut it into shorter takes.`;
  return null;
}
