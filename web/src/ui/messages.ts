/** What the page has to say: short notes that go by themselves, and errors that stay until they are read. */

import { el, setText } from "./dom";
import { icons } from "./icons";

export type Tone = "note" | "good" | "error";

const LASTS: Record<Tone, number> = { note: 5000, good: 5000, error: 14000 };
const MOST = 4;

export class Messages {
  readonly element = el("div", { class: "messages", role: "region", "aria-label": "Messages" });
  private readonly polite = el("div", { class: "message-list", role: "status", "aria-live": "polite" });
  private readonly loud = el("div", { class: "message-list", role: "alert", "aria-live": "assertive" });

  constructor() {
    this.element.append(this.loud, this.polite);
  }

  /** Say something. The same words again only make the message stay longer. */
  say(text: string, tone: Tone = "note", title = ""): void {
    const list = tone === "error" ? this.loud : this.polite;
    const words = `${title}|${text}`;
    const same = [...list.children].find((node) => (node as HTMLElement).dataset.words === words);
    same?.remove();
    const close = el(
      "button",
      { type: "button", class: "button icon small", "aria-label": "Close this message" },
      icons.close(),
    );
    const item = el(
      "div",
      { class: `message ${tone}` },
      el("p", {}, title && el("strong", {}, `${title} `), text),
      close,
    );
    item.dataset.words = words;
    const timer = setTimeout(() => item.remove(), LASTS[tone] + text.length * 40);
    close.addEventListener("click", () => {
      clearTimeout(timer);
      item.remove();
    });
    list.append(item);
    while (list.children.length > MOST) list.firstElementChild?.remove();
  }

  error(text: string, title = ""): void {
    this.say(text, "error", title);
  }
}

/** A number that is shown beside its name, in a list of such. */
export class Reading {
  readonly element: HTMLElement;
  private readonly value = el("dd", {}, "–");

  constructor(name: string, title?: string) {
    this.element = el("div", { class: "reading", title }, el("dt", {}, name), this.value);
  }

  set(text: string): void {
    setText(this.value, text);
  }
}
