/** The controls of the page: real inputs and buttons with labels, so that keys and screen readers work. */

import { el, setText, type Child } from "./dom";

let numbered = 0;
const newId = (word: string): string => `${word}-${++numbered}`;

export interface Control<T> {
  readonly element: HTMLElement;
  get(): T;
  /** Show a value without telling anybody. */
  set(value: T): void;
}

export interface SliderOptions {
  label: string;
  min: number;
  max: number;
  step: number;
  value: number;
  format?: (value: number) => string;
  hint?: string;
  onInput: (value: number) => void;
  onCommit?: (value: number) => void;
}

/** A slider with its label and value; a double click brings the first value back. */
export function slider(options: SliderOptions): Control<number> {
  const id = newId("slider");
  const format = options.format ?? ((value: number) => value.toFixed(2));
  const output = el("output", { for: id, class: "value" });
  const input = el("input", {
    id,
    type: "range",
    min: options.min,
    max: options.max,
    step: options.step,
    "aria-describedby": options.hint ? `${id}-hint` : undefined,
  });
  const show = (): void => {
    const value = Number(input.value);
    setText(output, format(value));
    input.setAttribute("aria-valuetext", format(value));
    input.style.setProperty("--filled", `${((value - options.min) / (options.max - options.min)) * 100}%`);
  };
  input.value = String(options.value);
  show();
  input.addEventListener("input", () => {
    show();
    options.onInput(Number(input.value));
  });
  input.addEventListener("change", () => options.onCommit?.(Number(input.value)));
  input.addEventListener("dblclick", () => {
    input.value = String(options.value);
    show();
    options.onInput(options.value);
    options.onCommit?.(options.value);
  });
  const element = el(
    "div",
    { class: "field slider" },
    el("label", { for: id }, options.label),
    output,
    input,
    options.hint && el("p", { id: `${id}-hint`, class: "hint" }, options.hint),
  );
  return {
    element,
    get: () => Number(input.value),
    set: (value) => {
      input.value = String(value);
      show();
    },
  };
}

export interface Choice<T extends string> {
  value: T;
  label: string;
  title?: string;
  icon?: () => Node;
}

/** One of several, as a row of radio buttons drawn as one piece. */
export function segmented<T extends string>(
  label: string,
  choices: readonly Choice<T>[],
  value: T,
  onChange: (value: T) => void,
  options: { hideLabel?: boolean; columns?: number } = {},
): Control<T> {
  const group = newId("choice");
  const inputs = new Map<T, HTMLInputElement>();
  const row = el("div", { class: options.columns ? `segments columns-${options.columns}` : "segments" });
  for (const choice of choices) {
    const id = newId("option");
    const input = el("input", { type: "radio", id, name: group, value: choice.value });
    input.checked = choice.value === value;
    input.addEventListener("change", () => {
      if (input.checked) onChange(choice.value);
    });
    inputs.set(choice.value, input);
    row.append(
      input,
      el("label", { for: id, title: choice.title }, choice.icon?.(), el("span", { class: "text" }, choice.label)),
    );
  }
  const element = el(
    "fieldset",
    { class: "field" },
    el("legend", { class: options.hideLabel ? "visually-hidden" : "" }, label),
    row,
  );
  return {
    element,
    get: () => ([...inputs].find(([, input]) => input.checked)?.[0] ?? value) as T,
    set: (next) => {
      for (const [key, input] of inputs) input.checked = key === next;
    },
  };
}

/** On or off. */
export function toggle(
  label: Child,
  value: boolean,
  onChange: (value: boolean) => void,
  swatch?: string,
): Control<boolean> {
  const id = newId("toggle");
  const input = el("input", { type: "checkbox", id });
  input.checked = value;
  input.addEventListener("change", () => onChange(input.checked));
  const element = el(
    "div",
    { class: "field toggle" },
    input,
    el("label", { for: id }, swatch && el("span", { class: `swatch ${swatch}` }), label),
  );
  return {
    element,
    get: () => input.checked,
    set: (next) => {
      input.checked = next;
    },
  };
}

export interface NumberOptions {
  label: string;
  value: number | null;
  min?: number;
  max?: number;
  step?: number;
  unit?: string;
  placeholder?: string;
  onCommit: (value: number | null) => void;
}

/** A number to be typed; what does not fit is told and not taken. */
export function numberField(options: NumberOptions): Control<number | null> {
  const id = newId("number");
  const input = el("input", {
    id,
    type: "number",
    min: options.min,
    max: options.max,
    step: options.step ?? "any",
    placeholder: options.placeholder,
    inputmode: "decimal",
  });
  const set = (value: number | null): void => {
    input.value = value === null ? "" : String(Math.round(value * 1000) / 1000);
  };
  set(options.value);
  input.addEventListener("change", () => {
    if (input.value === "" && options.value === null) return options.onCommit(null);
    if (input.checkValidity() && input.value !== "") options.onCommit(Number(input.value));
    else input.reportValidity();
  });
  return {
    element: el(
      "div",
      { class: "field number" },
      el("label", { for: id }, options.label),
      el("span", { class: "with-unit" }, input, options.unit && el("span", { class: "unit" }, options.unit)),
    ),
    get: () => (input.value === "" ? null : Number(input.value)),
    set,
  };
}

/** A line of text. */
export function textField(
  label: string,
  value: string,
  onCommit: (value: string) => void,
  placeholder = "",
): Control<string> {
  const id = newId("text");
  const input = el("input", {
    id,
    type: "text",
    maxlength: 200,
    placeholder,
    autocomplete: "off",
    spellcheck: "false",
  });
  input.value = value;
  input.addEventListener("change", () => onCommit(input.value.trim()));
  return {
    element: el("div", { class: "field number" }, el("label", { for: id }, label), input),
    get: () => input.value,
    set: (next) => {
      input.value = next;
    },
  };
}

/** A list to choose from. */
export function select<T extends string>(
  label: string,
  choices: readonly { value: T; label: string }[],
  value: T,
  onChange: (value: T) => void,
): Control<T> {
  const id = newId("select");
  const input = el("select", { id });
  for (const choice of choices) input.append(el("option", { value: choice.value }, choice.label));
  input.value = value;
  input.addEventListener("change", () => onChange(input.value as T));
  return {
    element: el("div", { class: "field number" }, el("label", { for: id }, label), input),
    get: () => input.value as T,
    set: (next) => {
      input.value = next;
    },
  };
}

export interface ButtonOptions {
  title?: string;
  kind?: "plain" | "primary" | "quiet";
  icon?: () => Node;
  key?: string;
}

/** A button. */
export function button(label: string, onClick: () => void, options: ButtonOptions = {}): HTMLButtonElement {
  const node = el(
    "button",
    {
      type: "button",
      class: `button ${options.kind ?? "plain"}`,
      title: options.title,
      "aria-keyshortcuts": options.key,
    },
    options.icon?.(),
    el("span", { class: "text" }, label),
  );
  node.addEventListener("click", onClick);
  return node;
}

/** A button that shows only a picture; its name is read out and shown as a tip. */
export function iconButton(label: string, icon: () => Node, onClick: () => void, key?: string): HTMLButtonElement {
  const node = el(
    "button",
    { type: "button", class: "button icon", title: key ? `${label} (${key})` : label, "aria-label": label },
    icon(),
  );
  node.addEventListener("click", onClick);
  return node;
}

/** A part of a panel with a heading; it can be folded. */
export function section(
  title: string,
  options: { open?: boolean; fold?: boolean } = {},
  ...children: Child[]
): HTMLElement {
  if (options.fold) {
    const details = el("details", { class: "section" }, el("summary", {}, title), ...children);
    details.open = options.open ?? true;
    return details;
  }
  return el("section", { class: "section" }, el("h2", {}, title), ...children);
}
